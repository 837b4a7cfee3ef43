"""The neutral image moved with every frame of a scene: a series of volumes, and slices with contours."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.views.move_images import Inputs, move_images

    move_images(inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake))
