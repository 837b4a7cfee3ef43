"""Distances from each scan to the simulated skins (000 Table 4)."""

import json

from common import stage
from figures import contact_figures, stage_cost

PREFIXES = {"m0": "", "m1": "m1_", "m2": "m2_"}

with stage(snakemake):
    import numpy as np
    import xarray as xr

    from handpipe import artifacts, metrics
    from handpipe.config import load_dataset
    from handpipe.evaluation.surfaces import surface_distance
    from handpipe.evaluation.table import skin_metrics, skin_rows
    from handpipe.hand.frames import read_frames
    from handpipe.mesh.surface import Surface, read_surface
    from handpipe.skeleton.rig import Rig

    dataset = load_dataset(snakemake.input.dataset)
    rig = Rig.load(snakemake.input.rig)
    errors, contacts = {}, {}
    for path, scan_path in zip(snakemake.input.skins, snakemake.input.scans, strict=True):
        [(frame, models)] = read_frames(path)
        points = rig.poses[frame.name].root.inverse()(read_surface(scan_path).vertices)
        errors[frame.name] = {
            model: surface_distance(points, Surface(shapes["skin"].vertices, shapes["skin"].cells))
            for model, shapes in models.items()
        }
        for model, shapes in models.items():
            contacts.setdefault(model, []).append(shapes["skin"].figures)
    rows = skin_rows(errors, {pose: dataset.poses[pose].role.value for pose in errors})
    figures = stage_cost(
        snakemake, "make_skin", "mesh_fat", "fit_fat_strains", "collect_fat_strains", "simulate_skin"
    )
    figures |= skin_metrics(rows)
    roles = {dataset.poses[pose].role.value for pose in errors}
    for role in roles:
        total = role if len(roles) > 1 else "all"
        for model, prefix in PREFIXES.items():
            for statistic in ("mean", "median", "max"):
                figures[f"{prefix}{role}_error_{statistic}"] = figures[f"skin_{total}_{model}_{statistic}"]
    for model, prefix in PREFIXES.items():
        figures |= contact_figures(contacts[model], prefix)
        figures[f"{prefix}overlap_max"] = (max(f["skin_overlap"] for f in contacts[model]), "mm")
    metrics.write(snakemake.output.metrics, figures)
    artifacts.write_text(snakemake.output.table, json.dumps(rows, indent=2))
    values = [
        [[statistic(e) for statistic in (np.mean, np.median, np.max)] for e in m.values()]
        for m in errors.values()
    ]
    table = xr.DataArray(
        np.array(values),
        coords={"pose": list(errors), "model": ["m0", "m1", "m2"], "statistic": ["mean", "median", "max"]},
        dims=("pose", "model", "statistic"),
        name="distance",
        attrs={"units": "mm", "long_name": "distance from the scan's vertices to the simulated skin"},
    )
    with artifacts.atomic(snakemake.output.array) as temporary:
        table.to_netcdf(temporary, engine="h5netcdf")
