"""Distances of scans from the simulated skin (Zheng 2022 Table 4), and of this from the true skin."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from handpipe.core import artifacts, metrics
from handpipe.core.configuration import Dataset
from handpipe.evaluation import skin_metrics, skin_rows
from handpipe.hand import read_frames
from handpipe.skeleton.rig import Rig
from handpipe.stages.costs import contact_figures, stage_cost
from handpipe.stages.files import Files
from handpipe.stages.skin_distances import skin_distances
from handpipe.tissues.fat import Skin

STATISTICS = ("mean", "median", "max")


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
    """Distances of scans from the simulated skin (Zheng 2022 Table 4), and of this from the true skin.

    Simpler models are compared by `evaluate_baselines`.
    """
    models = {frame.name: shapes for path in inputs.skins for frame, shapes in read_frames(path)}
    truth = inputs.truth if dataset.truth is not None else ()
    distances = skin_distances(Rig.load(inputs.rig), Skin.load(inputs.skin), models, inputs.scans, truth)
    errors, true_errors = distances.to_scan, distances.to_truth
    contacts = [shapes["m0"]["skin"].figures for shapes in models.values()]
    role_of = {pose: dataset.poses[pose].role.value for pose in errors}
    rows = skin_rows(errors, role_of)
    figures = stage_cost(costs)
    figures |= skin_metrics(rows) if rows else {}  # neutral alone has no pose to compare with
    roles = set(role_of.values())
    for kind, found in (("", rows), ("true_", skin_rows(true_errors, role_of))):
        totals = {row["pose"]: row for row in found}
        for role in roles if found else ():
            total = totals[role if len(roles) > 1 else "all"]
            for statistic in STATISTICS:
                figures[f"{kind}{role}_error_{statistic}"] = (float(total[f"m0_{statistic}"]), "mm")
    if contacts:
        figures |= contact_figures(contacts)
        figures["overlap_max"] = (max(f["skin_overlap"] for f in contacts), "mm")
    metrics.write(outputs.metrics, figures | _of_volumes(inputs.from_volume))
    artifacts.write_text(outputs.table, json.dumps(rows, indent=2))
    values = [[float(row[f"m0_{statistic}"]) for statistic in STATISTICS] for row in rows[: len(errors)]]
    table = xr.DataArray(
        np.array(values).reshape(-1, 1, len(STATISTICS)),
        coords={"pose": list(errors), "model": ["m0"], "statistic": [*STATISTICS]},
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
