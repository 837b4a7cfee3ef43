"""Figures of a scene's frames: inside what was seen, bones that collide, what solvers say, which failed."""

import json

from common import dataset_of, scene_of, stage

with stage(snakemake):
    from handpipe import artifacts, metrics
    from handpipe.config import Role
    from handpipe.evaluation.frames import figure_metrics, figure_names, with_figures
    from handpipe.hand.frames import read_simulated
    from handpipe.skeleton.drivers.scene_frames import read_frames
    from handpipe.skeleton.rig import Rig
    from handpipe.skeleton.validity import PoseValidity, validity_table

    dataset, scene = dataset_of(snakemake), scene_of(snakemake)
    rig = Rig.load(snakemake.input.rig)
    frames = read_frames(snakemake.input.frames, rig, hand=dataset.hand, bones=scene.bones)
    seen = [p for p in dataset.poses_of(Role.neutral, Role.example) if p in rig.poses]
    figures = {}
    with metrics.measured(figures):
        rows, found = validity_table(PoseValidity(rig, seen), frames)
        plain = list(rows[0])
        for chunk in snakemake.input.chunks:
            rows = with_figures(rows, *read_simulated(chunk))
        found |= figure_metrics(rows, figure_names(rows, plain))
    artifacts.write_text(snakemake.output.table, json.dumps(rows, indent=2))
    metrics.write(snakemake.output.metrics, found | figures)
