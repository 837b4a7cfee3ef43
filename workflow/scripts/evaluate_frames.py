"""Figures of a scene's frames: distance to what was seen, collisions, solvers, continuity, failures."""

from common import dataset_of, inputs_of, outputs_of, scene_of, stage

with stage(snakemake):
    from handpipe.stages.hand.evaluate_frames import Inputs, Outputs, evaluate_frames

    evaluate_frames(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        scene_of(snakemake),
    )
