"""Seeds of one pose of a generated subject, drawn into its true bones."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.datasets.seeds import draw

    dataset = dataset_of(snakemake)
    draw(dataset, snakemake.wildcards.pose)
