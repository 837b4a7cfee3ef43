"""Figures of a scene's frames: whether inside what was seen, collisions of bones, solvers, failures."""

from common import dataset_of, inputs_of, outputs_of, scene_of, stage

with stage(snakemake):
    from handpipe.stages.hand.evaluate_frames import Inputs, Outputs, evaluate_frames

    evaluate_frames(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        scene_of(snakemake),
    )
