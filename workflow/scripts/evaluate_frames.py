"""Figures of a scene's frames: inside what was seen, bones that collide, what solvers say, which failed."""

from common import dataset_of, inputs_of, outputs_of, scene_of, stage

with stage(snakemake):
    from handpipe.stages.hand.evaluate_frames import Inputs, Outputs, evaluate_frames

    evaluate_frames(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        scene_of(snakemake),
    )
