"""A person's feature points from one photograph with a ruler in it (Albrecht 2003 §5.1 and 5.2)."""

from __future__ import annotations

import logging
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from handpipe.anatomy.person.feature_points import NAMES, require_apart, require_enough
from handpipe.anatomy.person.subject_template import Side, SubjectTemplate
from handpipe.core import Array, InputError
from handpipe.core.configuration import Model, load_yaml

Pixel = tuple[float, float]

log = logging.getLogger(__name__)

SIZES = (0.3, 2.0)  # of a hand over the template: outside of them, the ruler is wrong
MISSING = "Field required"  # what pydantic says
RESIDUAL = 0.25  # share of the hand's own spread above which points do not look like a hand


class Photograph(Model):
    """What was clicked, in pixels: right from the left edge, down from the top edge."""

    points: dict[str, Pixel] = Field(description="feature points, any of the 26")
    ruler: tuple[Pixel, Pixel] = Field(description="two points on the ruler")
    distance: Annotated[float, Field(gt=0)] = Field(description="between them, mm")
    hand: Side = Field("right", description="which hand it is")
    view: Literal["back", "palm"] = Field("back", description="side of the hand that the camera sees")
    picture: str | None = Field(None, description="name of the picture's file")

    @model_validator(mode="after")
    def _sound(self) -> Photograph:
        if np.linalg.norm(np.subtract(*self.ruler)) < 1.0:
            raise ValueError("ruler: both points are at one place")
        for name in self.points:
            if name not in NAMES:
                raise ValueError(f"points: {name!r} is no feature point; use {', '.join(NAMES)}")
        return self

    @property
    def scale(self) -> float:
        """Millimetres a pixel."""
        return self.distance / float(np.linalg.norm(np.subtract(*self.ruler)))

    @property
    def in_mm(self) -> dict[str, Array]:
        """Points (2,) in mm, right and up."""
        return {name: self.scale * np.array(point) * [1.0, -1.0] for name, point in self.points.items()}


@dataclass(frozen=True, eq=False)
class Lifted:
    """Feature points of a photograph in the template's frame.

    Parameters
    ----------
    points : dict of str to array (3,)
        Points in mm by name.
    mirrored : bool
        Whether the photograph shows the mirror image of the template. The back of a hand of the template's
        side and the palm of the other hand are not mirrored.
    size : float
        Size of the hand over that of the template.
    residual : float
        Root mean square distance in mm, in the plane, after alignment.
    """

    points: dict[str, Array]
    mirrored: bool
    size: float
    residual: float


def read_photograph(path: str | Path) -> Photograph:
    """Read the points that a person clicked, from YAML.

    Parameters
    ----------
    path : path
        YAML file.

    Returns
    -------
    Photograph
        Points in pixels.

    Raises
    ------
    InputError
        For the first wrong field, without a scale, for too few points, and for points that coincide.
    """
    try:
        photograph = load_yaml(path, Photograph)
    except InputError as error:
        if error.field in ("ruler", "distance") and error.problem == MISSING:
            remedy = "Mark two points of the picture and state their distance in mm (`ruler`, `distance`)"
            raise InputError(path, "scale", f"{error.field} is missing", remedy) from error
        raise
    require_enough(photograph.points, path)
    require_apart(photograph.in_mm, path)
    return photograph


def from_photograph(
    template: SubjectTemplate,
    photograph: Photograph,
    origin: str | Path = "photograph",
    in_plane: Collection[str] = NAMES,
) -> Lifted:
    """Feature points in 3D from those in the photograph and the template's own, the source points.

    Points are brought to mm by the ruler and laid into the plane fitted to the source points, turned and
    shifted by the best rigid motion onto all of them (the paper aligns the largest diameters alone, which two
    points decide). The better fit decides whether the photograph shows a mirror image of the template: the
    thumb is on one side. Each point takes its source point's height over the plane, times the ratio of sizes,
    which is that of the best similarity. The photograph must be taken from straight above, since perspective
    makes fingers look shorter.

    Parameters
    ----------
    template : SubjectTemplate
        Template with feature points and the joints MP2 to MP5.
    photograph : Photograph
        Points in pixels, and the ruler.
    origin : path
        The file of the photograph's points, for messages.
    in_plane : collection of str
        Points to which the plane of the photograph is fitted, if the template has them.

    Returns
    -------
    Lifted
        Points in mm in the template's frame.

    Raises
    ------
    InputError
        For too few points, for points that do not look like a hand, and for a hand of impossible size, which
        indicates a wrong distance on the ruler.
    """
    source = template.feature_points
    names = [name for name in NAMES if name in source and name in photograph.points]
    require_enough(dict.fromkeys(names), origin)
    a = np.array([source[n] for n in names])
    middle, plane, normal = _fitting_plane(
        np.array([point for name, point in source.items() if name in in_plane]), _back(template)
    )
    flat, heights = (a - middle) @ plane.T, (a - middle) @ normal
    up = np.array([photograph.in_mm[n] for n in names])
    fits = [_aligned(up * [sign, 1.0], flat) for sign in (1.0, -1.0)]
    mirrored = fits[1][2] < fits[0][2]
    placed, size, residual = fits[1] if mirrored else fits[0]
    _require_hand(size, residual, flat, origin)
    lifted = middle + placed @ plane + (size * heights)[:, None] * normal
    log.info("%s: size %.2f of the template's, %.1f mm off in the plane", origin, size, residual)
    return Lifted(dict(zip(names, lifted, strict=True)), mirrored, size, residual)


def _fitting_plane(points: Array, back: Array) -> tuple[Array, Array, Array]:
    """The plane of least squares through points: a point, two directions and the normal.

    The point is (3,), the directions are two rows of unit vectors (2, 3), and the normal (3,) points to the
    side of `back`. Seen from there the first row turns to the second counter-clockwise.
    """
    middle = points.mean(axis=0)
    first, second, _ = np.linalg.svd(points - middle, full_matrices=False)[2]
    if np.cross(first, second) @ back < 0:
        second = -second
    return middle, np.array([first, second]), np.cross(first, second)


def _back(template: SubjectTemplate) -> Array:
    """Direction (3,) from palm to back: distal x flexion axis at the fingers' first knuckles."""
    parts = [
        np.cross(j.centre - template.bones[j.parent].vertices.mean(axis=0), j.axes[0])
        for j in template.joints
        if j.name in ("MP2", "MP3", "MP4", "MP5")
    ]
    if not parts:
        raise InputError("template", "joints", "MP2 to MP5 are missing", "Give a template with its joints")
    return np.sum(parts, axis=0)


def _aligned(points: Array, target: Array) -> tuple[Array, float, float]:
    """Points (n, 2) aligned rigidly with target points (n, 2), the ratio of sizes, and the residual in mm."""
    a, b = points - points.mean(axis=0), target - target.mean(axis=0)
    c, s = float((a * b).sum()), float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())
    length = float(np.hypot(c, s))
    turn = np.array([[c, -s], [s, c]]) / length
    ratio = float((a * a).sum() / length)  # of a turned onto b, by the similarity that fits b / ratio
    placed = a @ turn.T
    left = float(np.sqrt(((placed / ratio - b) ** 2).sum(axis=1).mean()))
    return placed + target.mean(axis=0), ratio, left


def _require_hand(size: float, residual: float, flat: Array, origin: str | Path) -> None:
    spread = float(np.sqrt(((flat - flat.mean(axis=0)) ** 2).sum(axis=1).mean()))
    if residual > RESIDUAL * spread:
        problem = f"are {residual:.0f} mm from a hand's in the mean"
        raise InputError(origin, "points", problem, "Look whether names are mixed up")
    if not SIZES[0] < size < SIZES[1]:
        problem = f"makes the hand {size:.2f} times as large as the template's"
        raise InputError(origin, "ruler", problem, "Check the two points on the ruler and their distance")
