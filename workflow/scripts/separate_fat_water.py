"""Fat and water of a pose from gradient echoes, as images on the grid of its volume."""

from common import dataset_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.images.separate_fat_water import Outputs, separate_fat_water

    separate_fat_water(outputs_of(snakemake, Outputs), dataset_of(snakemake), snakemake.wildcards.pose)
