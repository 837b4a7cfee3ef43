"""Seeds of one pose of a generated subject, drawn into its true bones."""

from common import stage

with stage(snakemake):
    from handpipe.config import load_dataset
    from handpipe.datasets.seeds import draw

    dataset = load_dataset(snakemake.input.dataset)
    draw(dataset, snakemake.wildcards.pose)
