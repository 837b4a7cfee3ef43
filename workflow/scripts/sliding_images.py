"""Volume, seeds, scan and truth of one pose of bodies that slide on one another."""

from common import dataset_of, inputs_of, stage

with stage(snakemake):
    from handpipe.stages.sliding.sliding_images import Inputs, sliding_images

    sliding_images(inputs_of(snakemake, Inputs), dataset_of(snakemake), snakemake.wildcards.pose)
