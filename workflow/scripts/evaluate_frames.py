"""Whether a scene's frames are inside what was seen, and whether their bones collide."""

import json

from common import dataset_of, scene_of, stage

with stage(snakemake):
    from handpipe import artifacts, metrics
    from handpipe.config import Role
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
    artifacts.write_text(snakemake.output.table, json.dumps(rows, indent=2))
    metrics.write(snakemake.output.metrics, found | figures)
