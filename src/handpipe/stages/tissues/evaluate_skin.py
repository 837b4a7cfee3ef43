"""Distances of scans from simulated skins (Zheng 2022 Table 4), and of these from the true skin."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
import xarray as xr

from handpipe.core import artifacts, metrics
from handpipe.core.configuration import Dataset
from handpipe.evaluation import skin_metrics, skin_rows, surface_distance
from handpipe.hand import read_frames
from handpipe.mesh.surfaces import Surface, read_scan
from handpipe.skeleton.rig import Rig
from handpipe.stages.costs import contact_figures, stage_cost
from handpipe.stages.files import Files
from handpipe.stages.truth import true_pose
from handpipe.tissues.fat import Skin

PREFIXES = {"m0": "", "m1": "m1_", "m2": "m2_"}


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    skin: Path
    scans: Sequence[Path]
    skins: Sequence[Path]
    truth: Sequence[Path]
    from_volume: Sequence[Path] = ()


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    metrics: Path
    table: Path
    array: Path


def evaluate_skin(inputs: Inputs, outputs: Outputs, dataset: Dataset, costs: Sequence[Path]) -> None:
    """Distances of scans from simulated skins (Zheng 2022 Table 4), and of these from the true skin."""
    rig = Rig.load(inputs.rig)
    rigid = Skin.load(inputs.skin).rigid
    cut = rigid["cut_end"].vertices if "cut_end" in rigid else np.zeros(0, dtype=int)
    errors: dict[str, dict[str, np.ndarray]] = {}
    true_errors: dict[str, dict[str, np.ndarray]] = {}
    contacts: dict[str, list[dict[str, float]]] = {}
    for path, scan_path in zip(inputs.skins, inputs.scans, strict=True):
        [(frame, models)] = read_frames(path)
        home = rig.poses[frame.name].root.inverse()
        points = home(read_scan(scan_path).vertices)
        skins = {n: Surface(shapes["skin"].vertices, shapes["skin"].cells) for n, shapes in models.items()}
        errors[frame.name] = {model: surface_distance(points, skin) for model, skin in skins.items()}
        if dataset.truth is not None:
            known = true_pose(inputs.truth, frame.name)["skin"]
            true = Surface(home(known["vertices"]), known["triangles"])
            true_errors[frame.name] = {
                model: surface_distance(np.delete(skin.vertices, cut, axis=0), true)
                for model, skin in skins.items()
            }
        for model, shapes in models.items():
            contacts.setdefault(model, []).append(shapes["skin"].figures)
    role_of = {pose: dataset.poses[pose].role.value for pose in errors}
    rows = skin_rows(errors, role_of)
    figures = stage_cost(costs)
    figures |= skin_metrics(rows)
    roles = set(role_of.values())
    for kind, found in (("", rows), ("true_", skin_rows(true_errors, role_of))):
        totals = {row["pose"]: row for row in found}
        for role, (model, prefix) in product(roles if found else (), PREFIXES.items()):
            total = totals[role if len(roles) > 1 else "all"]
            for statistic in ("mean", "median", "max"):
                figures[f"{prefix}{kind}{role}_error_{statistic}"] = (
                    float(total[f"{model}_{statistic}"]),
                    "mm",
                )
    for model, prefix in PREFIXES.items():
        figures |= contact_figures(contacts[model], prefix)
        figures[f"{prefix}overlap_max"] = (max(f["skin_overlap"] for f in contacts[model]), "mm")
    metrics.write(outputs.metrics, figures | _of_volumes(inputs.from_volume))
    artifacts.write_text(outputs.table, json.dumps(rows, indent=2))
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
    with artifacts.atomic(outputs.array) as temporary:
        table.to_netcdf(temporary, engine="h5netcdf")


def _of_volumes(files: Sequence[Path]) -> metrics.Metrics:
    """Figures of the skins that come from volumes: how many, and the worst of each; none where all are scans."""
    if not files:
        return {}
    read = [metrics.read(path) for path in files]
    return {
        "skin_from_volume_poses": (float(len(read)), ""),
        "skin_from_volume_sure_min": (min(f["sure"][0] for f in read), ""),
        "skin_from_volume_handles_max": (max(f["handles"][0] for f in read), ""),
    }
