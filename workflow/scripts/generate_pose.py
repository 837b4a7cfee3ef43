"""Volume, seeds, scan and truth of one pose of a generated subject."""

from common import stage

with stage(snakemake):
    from handpipe.config import load_dataset
    from handpipe.datasets import generators

    dataset = load_dataset(snakemake.input.dataset)
    generators.of(dataset).generate_pose(dataset, snakemake.wildcards.pose)
