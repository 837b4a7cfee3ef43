"""Angles of a scene's frames from keyframes, targets of inverse kinematics or tracked points."""

from common import dataset_of, inputs_of, outputs_of, scene_of, stage

with stage(snakemake):
    from handpipe.stages.hand.expand_motion import Inputs, Outputs, expand_motion

    expand_motion(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        scene_of(snakemake),
    )
