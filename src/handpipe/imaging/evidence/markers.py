"""Boundary markers of muscles: found along the normals of a guess, or placed by hand (Wang 2021, Sec. 5.1).

A marker is a point of the image through which the muscle's surface must pass; it does not say which vertex
should lie there. Where two muscles touch, the image shows no edge and no marker is made.
"""

from __future__ import annotations

import json
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field
from scipy import ndimage

from handpipe.core import Array, BoolArray, InputError, IntArray, write_text
from handpipe.core.configuration import Model
from handpipe.imaging.evidence.profiles import (
    BLUR,
    graph_laplacian,
    sample_profiles,
    smooth_field,
    summed_curvature,
)
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces import Surface

log = logging.getLogger(__name__)

STEP = 0.1  # mm between samples of a profile
GAP, WINDOW = 0.6, 1.0  # mm from an edge, between which the tissues on either side are looked at
STIFFNESS = 2.0  # of the markers' smooth offset against a measurement of full confidence
OUTSIDE = 0.4  # mm beyond the gap, in which a neighbour shows before it ends
OBLIQUE = 0.7  # twice the cosine between an edge's and the surface's normal, at which there is no confidence
LONGEST = 0.3  # mm of a Newton step to the half crossing
DEPTHS = (1.0, 3.5, 6)  # mm below a surface, from and to, and their number
GREY = (0.2, 0.7)  # of bright tissue: muscle


class MarkerSettings(Model):
    """How to search for boundary markers. Thin parts of a muscle are partly fat and look different."""

    search: float = Field(3.0, gt=0, description="along the normals, either way, mm")
    contrast: float = Field(0.3, gt=0, description="least step at an edge, as a part of the muscle's level")
    likeness: float = Field(
        0.3, gt=0, description="how unlike the muscle's level inside may be, as a part of it"
    )
    agreement: float = Field(0.6, gt=0, description="from the neighbours' edges, where trust falls, mm")
    least_confidence: float = Field(0.3, ge=0, le=1, description="markers below it are dropped")


@dataclass(frozen=True)
class ImageMarkers:
    """Points of an image through which a muscle's surface must pass.

    Parameters
    ----------
    points : array (k, 3)
        Places in world mm.
    normals : array (k, 3)
        Outward unit normals.
    confidence : array (k,)
        Confidence in each marker, in [0, 1].
    vertices : array (k,) of int
        Vertex of the guess from which each marker was found.
    """

    points: Array
    normals: Array
    confidence: Array
    vertices: IntArray


def boundary_markers(
    volume: Volume,
    surface: Surface,
    settings: MarkerSettings | None = None,
    forbid: BoolArray | None = None,
    muscle_level: float | None = None,
) -> ImageMarkers:
    """Markers at edges between muscle inside and another tissue outside, near the surface of a guess.

    An edge counts where the inside looks like muscle, the step is clear, the image's gradient runs along the
    normal, and the neighbours' edges agree. Curved edges, which blur moves inwards, are moved back by half
    its variance times the summed curvature.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    surface : Surface
        Guess of the muscle's surface in the pose, in world mm.
    settings : MarkerSettings, optional
        How to search; by default the settings' own defaults.
    forbid : array (n,) of bool, optional
        Vertices without a marker, such as attachments.
    muscle_level : float, optional
        Intensity of muscle; by default estimated inside the guess.

    Returns
    -------
    ImageMarkers
        Markers with a confidence of at least `settings.least_confidence`.

    Raises
    ------
    ConvergenceError
        If the smooth field of edges does not converge.
    """
    settings = settings or MarkerSettings.model_validate({})
    normals = surface.vertex_normals()
    level = muscle_level if muscle_level is not None else estimate_muscle_level(volume, surface)
    offsets = np.arange(-settings.search - WINDOW, settings.search + WINDOW + STEP / 2, STEP)
    profiles = sample_profiles(volume, surface.vertices, normals, offsets)
    positions, scores = _edges(profiles, offsets, level, settings)
    if forbid is not None:
        scores[forbid] = 0.0
    chosen, confidence = _consistent(surface, positions, scores, settings)
    blur = BLUR * float(volume.spacing.mean())
    curvature = np.clip(summed_curvature(surface), -1 / blur, 1 / blur)
    points = surface.vertices + (chosen + 0.5 * blur**2 * curvature)[:, None] * normals
    gradient = volume.gradient(points)
    along = np.abs(np.einsum("ij,ij->i", gradient, normals))
    confidence = confidence * np.clip(along / (np.linalg.norm(gradient, axis=1) + 1e-12) * 2 - OBLIQUE, 0, 1)
    kept = np.flatnonzero(confidence >= settings.least_confidence)
    return ImageMarkers(points[kept], normals[kept], confidence[kept], kept)


def estimate_muscle_level(volume: Volume, surface: Surface) -> float:
    """The commonest intensity within a guess of a muscle.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    surface : Surface
        Guess of the muscle's surface in the pose, in world mm.

    Returns
    -------
    float
        Mode of the intensities 1 to 3.5 mm below the surface.
    """
    depths = -np.linspace(*DEPTHS)
    values = sample_profiles(volume, surface.vertices, surface.vertex_normals(), depths).ravel()
    grey = values[(values > GREY[0] * volume.bright) & (values < GREY[1] * volume.bright)]
    values = np.sort(grey if len(grey) > len(values) // 10 else values)
    half = max(len(values) // 3, 1)
    start = int(np.argmin(values[half:] - values[:-half])) if len(values) > half else 0
    return float(np.median(values[start : start + half]))


def _edges(profiles: Array, offsets: Array, level: float, settings: MarkerSettings) -> tuple[Array, Array]:
    """Sub-voxel position and score in [0, 1] of the edge at each sample (n, m); score 0 where none is."""
    smooth = ndimage.gaussian_filter1d(profiles, 0.25 / STEP, axis=1, mode="nearest")
    slope = np.abs(np.gradient(smooth, axis=1))
    peak = (slope >= np.roll(slope, 1, axis=1)) & (slope > np.roll(slope, -1, axis=1))
    gap, width = round(GAP / STEP), round(WINDOW / STEP)
    inside = _shifted_mean(smooth, -width, -gap)
    outside = _shifted_mean(smooth, gap, gap + round(OUTSIDE / STEP))
    roughness = np.sqrt(np.maximum(_shifted_mean(smooth**2, -width, -gap) - inside**2, 0))
    unlike = np.hypot(inside - level, roughness) / (settings.likeness * level)
    step = np.abs(outside - level) / (settings.contrast * level)
    score = np.exp(-(unlike**2)) * np.clip(step - 1, 0, 1) * peak * (np.abs(offsets) <= settings.search)
    return _half_crossing(smooth, offsets, 0.5 * (inside + outside)), score


def _shifted_mean(values: Array, first: int, last: int) -> Array:
    """Mean over samples first..last relative to each sample of a row, borders repeated."""
    weights = np.ones(last - first + 1) / (last - first + 1)
    centre = (first + last) // 2
    rolled = ndimage.uniform_filter1d(values, len(weights), axis=1, mode="nearest")
    columns = np.clip(np.arange(values.shape[1]) + centre, 0, values.shape[1] - 1)
    return rolled[:, columns]


def _half_crossing(values: Array, offsets: Array, half: Array) -> Array:
    """One Newton step (n, m) from each sample to where its row has the value `half`, at most 0.3 mm."""
    slope = np.gradient(values, STEP, axis=1)
    safe = np.where(np.abs(slope) > 1e-12, slope, np.inf)
    return offsets + np.clip((half - values) / safe, -LONGEST, LONGEST)


def _consistent(
    surface: Surface, positions: Array, scores: Array, settings: MarkerSettings
) -> tuple[Array, Array]:
    """Each vertex's edge (n,) that agrees best with its neighbours', and its confidence (n,)."""
    laplacian = graph_laplacian(surface.triangles, len(surface.vertices))
    rows = np.arange(len(positions))
    field, width = np.zeros(len(positions)), settings.search
    for _ in range(4):
        likely = scores / (1 + ((positions - field[:, None]) / width) ** 2) ** 2
        pick = np.argmax(likely, axis=1)
        chosen, confidence = positions[rows, pick], scores[rows, pick]
        field, weights = smooth_field(laplacian, chosen, confidence, STIFFNESS, settings.agreement)
        width = max(width / 2, settings.agreement)
    return chosen, weights


PLACED, NOT_PLACED = ("defined",), ("undefined", "preview", "missing")
AREAS = ("ROI", "Plane")  # markups whose control points say how large they are, not where something is
UNITS = ("mm", "[mm]")


def read_markers(path: str | Path) -> tuple[Array, list[str]]:
    """Points of a 3D Slicer `.mrk.json` file, with their labels.

    Unplaced points are skipped, and the log names them.

    Parameters
    ----------
    path : str or Path
        File with one markup or several; its coordinates may be RAS or LPS.

    Returns
    -------
    points : array (k, 3)
        Points of all markups in the order of the file, RAS mm.
    labels : list of str
        Label of each point, empty if it has none.

    Raises
    ------
    InputError
        If the file is missing or malformed, is not in mm, holds areas instead of points, or has no placed
        point.
    """
    points, labels, skipped = list[Array](), list[str](), list[str]()
    markups = _markups(path)
    for number, markup in enumerate(markups):
        flip = _to_ras(path, markup, number)
        for index, point in enumerate(_control_points(path, markup, number)):
            field = f"markups[{number}].controlPoints[{index}]"
            label = str(point.get("label", ""))
            if not _is_placed(path, field, point):
                skipped.append(label or field)
                continue
            points.append(flip * _position(path, field, point))
            labels.append(label)
    if skipped:
        log.warning(
            "%s: %d points are not placed and are skipped: %s", path, len(skipped), ", ".join(skipped)
        )
    if not points:
        problem = f"none of {len(skipped)} is placed" if skipped else "there are none"
        raise InputError(path, "controlPoints", problem, "Place at least one point and save it again")
    if len(markups) > 1:
        log.info("%s: %d points of %d markups", path, len(points), len(markups))
    return np.array(points), labels


def _markups(path: str | Path) -> list[dict[str, Any]]:
    remedy = "Save the markups from 3D Slicer as .mrk.json"
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8-sig"))
    except FileNotFoundError as error:
        raise InputError(path, "file", "does not exist", "Check the path in the dataset file") from error
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(path, "JSON", f"cannot be read ({error})", remedy) from error
    markups = content.get("markups") if isinstance(content, dict) else None
    if not isinstance(markups, list) or not all(isinstance(m, dict) for m in markups):
        raise InputError(path, "markups", "is missing or not a list", remedy)
    for number, markup in enumerate(markups):
        if markup.get("type") in AREAS:
            problem = f"is {markup['type']!r}, whose control points are no marks"
            raise InputError(path, f"markups[{number}].type", problem, "Give points or curves")
    return markups


def _control_points(path: str | Path, markup: dict[str, Any], number: int) -> list[dict[str, Any]]:
    points = markup.get("controlPoints") or []
    if not isinstance(points, list) or not all(isinstance(p, dict) for p in points):
        problem = "is not a list of points"
        raise InputError(path, f"markups[{number}].controlPoints", problem, "Save it again from 3D Slicer")
    return points


def _is_placed(path: str | Path, field: str, point: dict[str, Any]) -> bool:
    """Whether a person has placed the point; the old position of an unplaced point means nothing."""
    status = point.get("positionStatus", PLACED[0])
    if status not in (*PLACED, *NOT_PLACED):
        known = ", ".join((*PLACED, *NOT_PLACED))
        raise InputError(path, f"{field}.positionStatus", f"is {status!r}", f"It is one of {known}")
    return status in PLACED


def _to_ras(path: str | Path, markup: dict[str, Any], number: int) -> Array:
    """Signs (3,) that turn a markup's coordinates to RAS."""
    units = markup.get("coordinateUnits", "mm")
    if not any(unit in UNITS for unit in (units if isinstance(units, list) else [units])):
        raise InputError(path, f"markups[{number}].coordinateUnits", f"is {units!r}, not mm", "Save it in mm")
    system = markup.get("coordinateSystem", "LPS")
    signs = {"RAS": np.ones(3), "0": np.ones(3), "LPS": np.array([-1.0, -1, 1]), "1": np.array([-1.0, -1, 1])}
    if str(system) not in signs:
        raise InputError(path, f"markups[{number}].coordinateSystem", f"is {system!r}", "Use RAS or LPS")
    return signs[str(system)]


def _position(path: str | Path, field: str, point: dict[str, Any]) -> Array:
    try:
        position = np.asarray(point["position"], dtype=float)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        problem = "is missing or not three numbers"
        raise InputError(path, f"{field}.position", problem, "Place the point") from error
    if position.shape != (3,) or not np.isfinite(position).all():
        raise InputError(path, f"{field}.position", "is not three finite numbers", "Place the point")
    return position


def read_landmarks(path: str | Path) -> dict[str, Array]:
    """Landmarks of a `.mrk.json` file by their labels.

    Parameters
    ----------
    path : str or Path
        File as `read_markers` takes it.

    Returns
    -------
    dict of str to array (3,)
        Place of each landmark, RAS mm.

    Raises
    ------
    InputError
        As `read_markers` does, and if two landmarks share a label.
    """
    points, labels = read_markers(path)
    for label in labels:
        if labels.count(label) > 1:
            raise InputError(
                path, "label", f"{label!r} stands twice", "Give each landmark a label of its own"
            )
    return dict(zip(labels, points, strict=True))


def write_markers(
    path: str | Path, points: Array, labels: list[str] | None = None, kind: str = "Fiducial"
) -> None:
    """Write points as one markup of 3D Slicer.

    Parameters
    ----------
    path : str or Path
        File to write, `.mrk.json`.
    points : array (k, 3)
        Points in RAS mm.
    labels : list of str, optional
        Label of each point; by default its number.
    kind : str
        Fiducial or Curve.
    """
    names = labels or [str(i) for i in range(len(points))]
    controls = [
        {"id": str(i), "label": name, "position": [float(c) for c in point], "positionStatus": "defined"}
        for i, (name, point) in enumerate(zip(names, points, strict=True))
    ]
    schema = (
        "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/"
        "Resources/Schema/markups-schema-v1.0.3.json#"
    )
    markup = {"type": kind, "coordinateSystem": "RAS", "coordinateUnits": "mm", "controlPoints": controls}
    write_text(path, json.dumps({"@schema": schema, "markups": [markup]}, indent=1) + "\n")
