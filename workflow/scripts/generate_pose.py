"""Volume, seeds, scan and truth of one pose of a generated subject."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.datasets import generators

    dataset = dataset_of(snakemake)
    generators.of(dataset).generate_pose(dataset, snakemake.wildcards.pose)
