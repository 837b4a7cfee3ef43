"""Figures of solvers by frame and layer, and warnings in plain words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from handpipe.core import Metrics, Shapes
from handpipe.evaluation.table import Row
from handpipe.hand import POP, Failure, SimulatedFrame
from handpipe.hand import UNITS as ARTIFACT_UNITS

UNITS = ARTIFACT_UNITS | {"inverted_tets": "tets"}
LEAST = ("least_det", "skin_gap")  # figures whose smallest value is the worst
OVERLAP = 0.01  # mm; the report omits a smaller overlap of the skin
PENETRATION = 0.25  # mm, of muscles in bones and in one another: half of what is wrong of a muscle's surface
BONES_OUTSIDE = 0.1  # mm, as much as the skin keeps over a bone: beyond it a bone shows
INNER_OVERLAP = 0.5  # mm; half a voxel of a usual scan: less is within the error of the bodies' surfaces
REACHED = 1.0  # mm; a target that is farther is not met
NOISE = 0.03  # mm, of a good scan: a fit that stops nearer to its scan leaves nothing that counts
COMPRESSION = 0.01  # of a tendon's pull; the report omits a smaller compression


def worst_figures(layers: Mapping[str, Shapes]) -> dict[str, float]:
    """Worst value of each figure over the bodies of each layer.

    Parameters
    ----------
    layers : mapping of str to Shapes
        Shapes of a frame by layer and body.

    Returns
    -------
    mapping of str to float
        Worst value by `{layer}_{figure}`, see `worst_of`.
    """
    return worst_of({layer: [s.figures for s in shapes.values()] for layer, shapes in layers.items()})


def worst_of(figures: Mapping[str, Iterable[Mapping[str, float]]]) -> dict[str, float]:
    """Worst value of each figure over the solutions of each stage.

    Parameters
    ----------
    figures : mapping of str to iterable of mapping of str to float
        Figures by stage, and in a stage one mapping of names to values per solution.

    Returns
    -------
    mapping of str to float
        Worst value by `{stage}_{figure}`: the smallest of `least_det` and `skin_gap`, else the largest; NaN
        if any value is NaN.
    """
    found: dict[str, list[float]] = {}
    for stage, solved in figures.items():
        for each in solved:
            for name, value in each.items():
                found.setdefault(f"{stage}_{name}", []).append(float(value))
    return {name: _worst(name, values) for name, values in found.items()}


def _worst(name: str, values: Iterable[float]) -> float:
    """The worst value; NaN is worse than any other."""
    return float(np.min([*values]) if name.endswith(LEAST) else np.max([*values]))


def with_figures(
    rows: Sequence[Row], frames: Iterable[SimulatedFrame], failures: Iterable[Failure]
) -> list[Row]:
    """Rows of `validity_table` with the frames' figures, or the layer that failed and its reason.

    Parameters
    ----------
    rows : sequence of Row
        Rows with the frame's name in `frame`.
    frames : iterable of SimulatedFrame
        Simulated frames with their shapes.
    failures : iterable of Failure
        Failed frames; their rows get `failed`, the layer, and `reason`.

    Returns
    -------
    list of Row
        The rows in their order, figures named as by `worst_figures`.
    """
    figures = {frame.name: worst_figures(layers) for frame, layers in frames}
    failed = {f.frame: {"failed": f.layer, "reason": f.reason} for f in failures}
    return [{**row, **figures.get(_name(row), {}), **failed.get(_name(row), {})} for row in rows]


def figure_metrics(rows: Sequence[Row], names: Iterable[str]) -> Metrics:
    """Number of failed frames, and the worst of each figure over the other frames.

    Parameters
    ----------
    rows : sequence of Row
        Rows of `with_figures`.
    names : iterable of str
        Figures that are taken from the rows.

    Returns
    -------
    Metrics
        `frames_failed`, and value and unit by figure.
    """
    failed = float(sum("failed" in row for row in rows))
    return {"frames_failed": (failed, "frames"), **_worst_metrics(rows, names)}


def pose_metrics(rows: Sequence[Row]) -> Metrics:
    """Worst value of each figure over the poses, and each pose's own as `{figure}_{pose}`.

    Parameters
    ----------
    rows : sequence of Row
        A row for each pose: its name in `frame`, and its figures.

    Returns
    -------
    Metrics
        Value and unit by name.
    """
    metrics = _worst_metrics(rows, figure_names(rows, ["frame"]))
    for row in rows:
        own = _worst_metrics([row], figure_names([row], ["frame"]))
        metrics |= {f"{name}_{_name(row)}": value for name, value in own.items()}
    return metrics


def _worst_metrics(rows: Sequence[Row], names: Iterable[str]) -> Metrics:
    found = {
        name: [_number(row, name) for row in rows if row.get(name) is not None] for name in sorted(names)
    }
    return {name: (_worst(name, values), _unit(name)) for name, values in found.items()}


def _unit(name: str) -> str:
    return next((unit for figure, unit in UNITS.items() if name.endswith(figure)), "1")


def figure_names(rows: Sequence[Row], plain: Iterable[str]) -> list[str]:
    """Columns of rows that hold figures of solvers: all but the plain ones and those of failures.

    Parameters
    ----------
    rows : sequence of Row
        Rows of `with_figures`.
    plain : iterable of str
        Columns that are no figures.

    Returns
    -------
    list of str
        Names, each once, in the order of their first row.
    """
    known = {*plain, "failed", "reason"}
    return list(dict.fromkeys(name for row in rows for name in row if name not in known))


def frame_warnings(scene: str, rows: Sequence[Row]) -> list[str]:
    """Sentences on what is wrong or doubtful in a scene's frames.

    Parameters
    ----------
    scene : str
        Name of the scene.
    rows : sequence of Row
        Rows of `with_figures`.

    Returns
    -------
    list of str
        A sentence for each kind of doubt, with the frames' names.
    """
    return _warnings(f"Scene {scene}", rows)


def pose_warnings(rows: Sequence[Row]) -> list[str]:
    """Sentences on what is wrong or doubtful in fits and simulations of scanned poses.

    Parameters
    ----------
    rows : sequence of Row
        A row for each pose: its name in `frame`, and its figures.

    Returns
    -------
    list of str
        A sentence for each kind of doubt, with the poses' names.
    """
    return _warnings("Scanned poses", rows)


def _warnings(where: str, rows: Sequence[Row]) -> list[str]:
    found: dict[str, list[str]] = {}
    for row in rows:
        for kind, detail in dict.fromkeys(_doubts(row)):
            found.setdefault(kind, []).append(f"{_name(row)} ({detail})")
    return [f"{where}: {kind}: {', '.join(frames)}." for kind, frames in found.items()]


def _doubts(row: Row) -> Iterable[tuple[str, str]]:
    """What is doubtful in a frame: its kind and the detail."""
    if "failed" in row:
        yield "not simulated and left out", f"{row['failed']}: {str(row['reason']).rstrip('.')}"
    for name in row:
        layer, _, _ = name.partition("_inverted_tets")
        if name.endswith("_inverted_tets") and _positive(row, name):
            least = f", least det F {_number(row, f'{layer}_least_det'):.3g}" if _has(row, layer) else ""
            yield "inverted tets are handed on", f"{layer}: {_number(row, name):.0f}{least}"
        if name.endswith("_tangles") and _positive(row, name):
            yield "tangles are left", f"{name.removesuffix('_tangles')}: {_number(row, name):.0f}"
        if name.endswith("_unsettled") and _positive(row, name):
            yield "contact has not settled", name.removesuffix("_unsettled").removesuffix("_contact")
        gap = f"{name.removesuffix('_unfinished')}_mean_gap"
        if name.endswith("_unfinished") and _positive(row, name) and _positive(row, gap, NOISE):
            left = f"skin {_number(row, gap):.2f} mm from it in the mean"
            yield "the fit to the scan has not converged", left
        if name.endswith("_cuts_itself") and _positive(row, name):
            yield "an organ folds into itself", name.removesuffix("_cuts_itself")
        if name.endswith("_skin_crossings") and _positive(row, name):
            layer = name.removesuffix("_skin_crossings")
            yield "the skin crosses itself", f"{layer}: {_number(row, name):.0f} edges through triangles"
        if name.endswith("_body_penetration") and _positive(row, name, PENETRATION):
            yield "organs lie in bones or in one another", _depth(row, name, "_body_penetration")
        if name.endswith("_skin_overlap") and _positive(row, name, OVERLAP):
            yield "the skin penetrates itself", _depth(row, name, "_skin_overlap")
        if name.endswith("_bones_outside") and _positive(row, name, BONES_OUTSIDE):
            yield "bones come through the skin", _depth(row, name, "_bones_outside")
        if name.endswith("_inner_overlap") and _positive(row, name, INNER_OVERLAP):
            yield "tissue penetrates the organs inside", _depth(row, name, "_inner_overlap")
        if name.endswith("_level_distance") and _positive(row, name, 1.0):
            farther = f"{_number(row, name):.1f} times the farthest of them"
            yield (
                "the pose is unlike those that the level is learned from; its stated errors do not hold",
                farther,
            )
        if name.endswith("_compression") and _positive(row, name, COMPRESSION):
            yield "tendons are compressed and folded", f"{_number(row, name):.1f} of the pull"
    if _positive(row, "pop", POP):
        where = f"{row['pop_body']}: {_number(row, 'unexplained'):.2f} mm beyond what its bones explain"
        yield "the shape jumps from the frame before", f"{where}, {_number(row, 'joint_motion'):.1f} deg"
    if _positive(row, "other_equilibria"):
        energy = f"elastic energy {_number(row, 'other_energy'):.3f} of the frame's"
        where = (
            f"skin up to {_number(row, 'other_skin_max'):.2f} mm from the frame's, {energy}; "
            f"start: {row['other_start']}"
        )
        yield "there are other equilibria; the one from the examples' shapes is taken", where
    if _positive(row, "target_distance", REACHED):
        yield "targets are not reached", f"{_number(row, 'target_distance'):.1f} mm are left"
    if _positive(row, "bridged"):
        yield "the recording has a gap that is bridged", "interpolated"
    if _number(row, "beyond"):
        yield "outside the range of the scans", f"{row['angle']} by {_number(row, 'beyond'):+.1f} deg"
    if _positive(row, "depth"):
        yield "bones penetrate each other", f"{row['bones']}, {_number(row, 'depth'):.2f} mm"


def _depth(row: Row, name: str, figure: str) -> str:
    """The layer and the depth in mm that a figure gives."""
    return f"{name.removesuffix(figure)}: {_number(row, name):.2f} mm"


def _has(row: Row, layer: str) -> bool:
    return f"{layer}_least_det" in row


def _positive(row: Row, name: str, limit: float = 0.0) -> bool:
    """Whether a figure is above a limit; NaN counts as above."""
    return not _number(row, name) <= limit


def _number(row: Row, name: str) -> float:
    value = row.get(name)
    return float(value) if value is not None else 0.0


def _name(row: Row) -> str:
    return str(row["frame"])
