"""Distances from each scan to the simulated skins (Zheng 2022 Table 4), and from these to the true skin."""

import json
from itertools import product

from common import dataset_of, stage
from figures import contact_figures, stage_cost

PREFIXES = {"m0": "", "m1": "m1_", "m2": "m2_"}

with stage(snakemake):
    import numpy as np
    import xarray as xr

    from handpipe import artifacts, metrics
    from handpipe.evaluation.surfaces import surface_distance
    from handpipe.evaluation.table import skin_metrics, skin_rows
    from handpipe.fat.skin import Skin
    from handpipe.hand.frames import read_frames
    from handpipe.mesh.scan import read_scan
    from handpipe.mesh.surface import Surface
    from handpipe.skeleton.rig import Rig
    from truth import true_pose

    dataset = dataset_of(snakemake)
    rig = Rig.load(snakemake.input.rig)
    rigid = Skin.load(snakemake.input.skin).rigid
    cut = rigid["cut_end"].vertices if "cut_end" in rigid else []
    errors, true_errors, contacts = {}, {}, {}
    for path, scan_path in zip(snakemake.input.skins, snakemake.input.scans, strict=True):
        [(frame, models)] = read_frames(path)
        home = rig.poses[frame.name].root.inverse()
        points = home(read_scan(scan_path).vertices)
        skins = {n: Surface(shapes["skin"].vertices, shapes["skin"].cells) for n, shapes in models.items()}
        errors[frame.name] = {model: surface_distance(points, skin) for model, skin in skins.items()}
        if dataset.truth is not None:
            known = true_pose(dataset, frame.name)["skin"]
            true = Surface(home(known["vertices"]), known["triangles"])
            true_errors[frame.name] = {
                model: surface_distance(np.delete(skin.vertices, cut, axis=0), true)
                for model, skin in skins.items()
            }
        for model, shapes in models.items():
            contacts.setdefault(model, []).append(shapes["skin"].figures)
    role_of = {pose: dataset.poses[pose].role.value for pose in errors}
    rows = skin_rows(errors, role_of)
    figures = stage_cost(
        snakemake, "make_skin", "mesh_fat", "fit_fat_strains", "collect_fat_strains", "simulate_skin"
    )
    figures |= skin_metrics(rows)
    roles = set(role_of.values())
    for kind, found in (("", rows), ("true_", skin_rows(true_errors, role_of))):
        totals = {row["pose"]: row for row in found}
        for role, (model, prefix) in product(roles if found else (), PREFIXES.items()):
            total = totals[role if len(roles) > 1 else "all"]
            for statistic in ("mean", "median", "max"):
                figures[f"{prefix}{kind}{role}_error_{statistic}"] = (total[f"{model}_{statistic}"], "mm")
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
