"""Distances of simulated skins of scanned poses from the scans and, where it is known, from the true skin."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, IntArray, Metrics, RigidTransform, Shapes
from handpipe.evaluation import surface_distance
from handpipe.mesh.files import read_scan
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.rig import Rig
from handpipe.stages.truth import true_pose
from handpipe.tissues.fat import Skin

ByModel = dict[str, Array]


@dataclass(frozen=True)
class SkinDistances:
    """Distances in mm by pose and model: of a scan's vertices from the skin, of the skin's from the truth.

    compared: vertices of the skin whose distances `to_truth` has, those of the cut end left out.
    """

    to_scan: dict[str, ByModel]
    to_truth: dict[str, ByModel]
    compared: IntArray


def skin_distances(
    rig: Rig,
    skin: Skin,
    models: Mapping[str, Mapping[str, Shapes]],
    scans: Iterable[Path],
    truth: Sequence[Path] = (),
) -> SkinDistances:
    """Distances of the skins of poses and their models.

    scans: one file a pose of `models`, in their order; truth: files of the true poses, none where no truth is
    known. Vertices where the scan was cut are compared with no true skin.
    """
    cut = skin.rigid["cut_end"].vertices if "cut_end" in skin.rigid else np.zeros(0, dtype=int)
    compared = np.delete(np.arange(len(skin.surface.vertices)), cut)
    found = SkinDistances({}, {}, compared)
    for (pose, shapes), scan in zip(models.items(), scans, strict=True):
        home = rig.poses[pose].root.inverse()
        points = home(read_scan(scan).vertices)
        skins = {model: Surface(s["skin"].vertices, s["skin"].cells) for model, s in shapes.items()}
        found.to_scan[pose] = {model: surface_distance(points, surface) for model, surface in skins.items()}
        if truth:
            true = _true_skin(truth, pose, home)
            found.to_truth[pose] = {
                model: surface_distance(surface.vertices[compared], true) for model, surface in skins.items()
            }
    return found


def role_figures(
    found: SkinDistances, role_of: Mapping[str, str]
) -> tuple[Metrics, list[dict[str, str | float]]]:
    """Figures of each model over the poses of a role, and the same as rows of a table.

    Figures are `{model}_{role}_error_{statistic}` to scans and `{model}_true_{role}_error_{statistic}` to the
    true skin, in mm: the mean over the role's poses of the means, and the largest.
    """
    figures: Metrics = {}
    rows: list[dict[str, str | float]] = []
    for kind, distances in (("", found.to_scan), ("true_", found.to_truth)):
        for (model, role), (mean, largest) in _totals(distances, role_of).items():
            figures[f"{model}_{kind}{role}_error_mean"] = (mean, "mm")
            figures[f"{model}_{kind}{role}_error_max"] = (largest, "mm")
            to = "truth" if kind else "scan"
            rows.append({"model": model, "to": to, "role": role, "mean": mean, "max": largest})
    return figures, rows


def _totals(
    distances: Mapping[str, ByModel], role_of: Mapping[str, str]
) -> dict[tuple[str, str], tuple[float, float]]:
    """Mean of the poses' means and largest distance in mm, by model and role."""
    totals = {}
    for role in dict.fromkeys(role_of.values()):
        poses = [by_model for pose, by_model in distances.items() if role_of[pose] == role]
        for model in poses[0] if poses else ():
            means = [float(np.mean(by_model[model])) for by_model in poses]
            largest = max(float(np.max(by_model[model])) for by_model in poses)
            totals[model, role] = (float(np.mean(means)), largest)
    return totals


def _true_skin(truth: Sequence[Path], pose: str, home: RigidTransform) -> Surface:
    known = true_pose(truth, pose)["skin"]
    return Surface(home(known["vertices"]), known["triangles"])
