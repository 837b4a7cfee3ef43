"""A real limb's image in the build's unit, without the coil's shading."""

from pathlib import Path

from common import dataset_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.images.prepare_image import prepare_image

    prepare_image(Path(snakemake.input[0]), output_of(snakemake), dataset_of(snakemake))
