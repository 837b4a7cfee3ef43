"""A scan in its own frame, aligned to the skin in the volume of its pose."""

from common import dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.skeleton.align_scan import Inputs, Outputs, align_scan

    align_scan(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        snakemake.wildcards.pose,
    )
