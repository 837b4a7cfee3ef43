"""What solvers say of the scanned poses: of the layers simulated there, and of the fits to their scans."""

import json
from pathlib import Path

from common import stage

with stage(snakemake):
    from handpipe import artifacts, metrics
    from handpipe.evaluation.frames import pose_metrics, worst_figures, worst_of
    from handpipe.hand.frames import read_frames

    MODELS = {"m0": "fat"}  # the full model of `simulate_skin` is that of the scenes
    rows = {}
    for path in snakemake.input.simulated:
        [(frame, layers)] = read_frames(path)
        named = {MODELS.get(name, name): shapes for name, shapes in layers.items()}
        rows.setdefault(frame.name, {"frame": frame.name}).update(worst_figures(named))
    for path in snakemake.input.fits:
        pose = Path(path).stem
        figures = artifacts.read(path, "fat_fit")["figures"]
        rows.setdefault(pose, {"frame": pose}).update(worst_of({"fat_fit": [figures]}))
    artifacts.write_text(snakemake.output.table, json.dumps([*rows.values()], indent=2))
    metrics.write(snakemake.output.metrics, pose_metrics([*rows.values()]))
