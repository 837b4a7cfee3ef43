"""The neutral image moved into a scanned pose, beside the pose's own image, and how alike they are."""

from common import dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.views.move_image import Inputs, Outputs, move_image

    move_image(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        snakemake.wildcards.pose,
    )
