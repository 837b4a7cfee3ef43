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
from handpipe.evaluation import SIMULATED_MODELS, skin_metrics, skin_rows
from handpipe.hand import read_frames
from handpipe.skeleton.rig import Rig
from handpipe.stages.costs import contact_figures, stage_cost
from handpipe.stages.files import Files
from handpipe.stages.skin_distances import skin_distances
from handpipe.tissues.fat import Skin

PREFIXES = {model: "" if model == "m0" else f"{model}_" for model in SIMULATED_MODELS}


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
    models = {frame.name: shapes for path in inputs.skins for frame, shapes in read_frames(path)}
    truth = inputs.truth if dataset.truth is not None else ()
    distances = skin_distances(Rig.load(inputs.rig), Skin.load(inputs.skin), models, inputs.scans, truth)
    errors, true_errors = distances.to_scan, distances.to_truth
    contacts = {m: [shapes[m]["skin"].figures for shapes in models.values()] for m in PREFIXES if models}
    role_of = {pose: dataset.poses[pose].role.value for pose in errors}
    rows = skin_rows(errors, role_of)
    figures = stage_cost(costs)
    figures |= skin_metrics(rows) if rows else {}  # neutral alone has no pose to compare with
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
    for model, prefix in PREFIXES.items() if contacts else ():
        figures |= contact_figures(contacts[model], prefix)
        figures[f"{prefix}overlap_max"] = (max(f["skin_overlap"] for f in contacts[model]), "mm")
    metrics.write(outputs.metrics, figures | _of_volumes(inputs.from_volume))
    artifacts.write_text(outputs.table, json.dumps(rows, indent=2))
    values = [
        [[statistic(e) for statistic in (np.mean, np.median, np.max)] for e in m.values()]
        for m in errors.values()
    ]
    table = xr.DataArray(
        np.array(values).reshape(-1, 3, 3),
        coords={"pose": list(errors), "model": [*SIMULATED_MODELS], "statistic": ["mean", "median", "max"]},
        dims=("pose", "model", "statistic"),
        name="distance",
        attrs={"units": "mm", "long_name": "distance from the scan's vertices to the simulated skin"},
    )
    with artifacts.atomic(outputs.array) as temporary:
        table.to_netcdf(temporary, engine="h5netcdf")


def _of_volumes(files: Sequence[Path]) -> metrics.Metrics:
    """Figures of the skins that come from volumes: how many, and the worst; none where all are scans."""
    if not files:
        return {}
    read = [metrics.read(path) for path in files]
    return {
        "skin_from_volume_poses": (float(len(read)), ""),
        "skin_from_volume_sure_min": (min(f["sure"][0] for f in read), ""),
        "skin_from_volume_handles_max": (max(f["handles"][0] for f in read), ""),
    }
