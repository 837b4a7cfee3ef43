"""Muscles as curves in a text file: control points, tissue values, anisotropy, attachments.

Control points are on bones or in space (Abdrashitov 2021 §3.2 and 3.7). A muscle may have several curves and
attachments, which the users of that method asked for (section 5).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import numpy as np
from pydantic import Field, model_validator
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from handpipe.core import Array, InputError, IntArray
from handpipe.core.configuration import Model, Name, Vector, load_yaml
from handpipe.mesh.surfaces import Distance, Surface, arclength, bishop_frames, resample, tangents

Positive = Annotated[float, Field(gt=0)]
PARALLEL = 1e-3  # sine of the angle between a normal and its curve, below which there is no angle
MEASURED = 200  # points by which a curve's length is measured
FINER = 20  # points of a curve for each that is kept


class CurvePlace(Model):
    """Where a point is: `at` in mm, or on a `bone`."""

    at: Vector | None = Field(None, description="coordinates in mm, in the frame of the bones")
    bone: Name | None = Field(None, description="the bone whose surface carries the point")
    along: float = Field(0.5, ge=0, le=1, description="place along the bone's long axis, 1 at its distal end")
    towards: Vector | None = Field(None, description="direction from the bone's axis to the point")
    height: float = Field(0.0, description="mm above the bone's surface in that direction")

    @model_validator(mode="after")
    def _one_kind(self) -> CurvePlace:
        on_bone = {"along", "towards", "height"} & self.model_fields_set
        if (self.at is None) == (self.bone is None):
            raise ValueError("at: a point has either `at` or `bone`")
        if self.at is not None and on_bone:
            raise ValueError(f"{sorted(on_bone)[0]}: is for points on a `bone`")
        if self.bone is not None and (self.towards is None or not any(self.towards)):
            raise ValueError("towards: a point on a bone needs a direction that is not zero")
        return self


class ControlPoint(CurvePlace):
    """A point of a curve; values between control points are interpolated without overshoot."""

    tissue: Positive = Field(1.0, description="tissue value: larger makes the muscle thicker here")
    spread: tuple[Positive, Positive] = Field(
        (1.0, 1.0),
        description="rates of diffusion across the curve over that along it: along `normal`, and "
        "along the third direction",
    )


class Curve(Model):
    """From origin to insertion."""

    points: tuple[ControlPoint, ...] = Field(min_length=2)
    normal: Vector | None = Field(
        None,
        description="direction of the first of the `spread` rates at the curve's start; carried on "
        "along the curve without twist",
    )

    @model_validator(mode="after")
    def _direction(self) -> Curve:
        if self.normal is None and any(p.spread[0] != p.spread[1] for p in self.points):
            raise ValueError("normal: is needed where the two rates of a `spread` differ")
        return self


class FurtherAttachment(Model):
    """A further place where a muscle is attached: all of it within `reach` of the line through `points`."""

    end: Literal["origin", "insertion"]
    points: tuple[CurvePlace, ...] = Field(min_length=1)
    reach: Positive = Field(3.0, description="mm")


class MuscleCurves(Model):
    """One muscle."""

    curves: tuple[Curve, ...] = Field(min_length=1)
    attachments: tuple[FurtherAttachment, ...] = Field((), description="besides the ends of its curves")
    reach: Positive = Field(3.0, description="mm around the ends of its curves that are attached")
    volume: Positive | None = Field(None, description="volume in mm^3 that it is to have")
    edge_length: Positive | None = Field(
        None, description="mm, of tets along its curves: for a muscle thinner than the tets are elsewhere"
    )
    fibres: Literal["gradient", "flow"] = Field(
        "gradient",
        description="gradient: from origin to insertion as the paper has it; flow: along the "
        "curves also where attachments are oblique to them (pennate muscles)",
    )


class CurveFile(Model):
    """The muscles of a template, and its fat."""

    units: Literal["mm"] = "mm"
    distal: Vector = Field((1.0, 0.0, 0.0), description="rough direction of all bones' distal ends")
    fat: Positive = Field(0.5, description="tissue value of the fat at the skin")
    muscles: dict[Name, MuscleCurves] = Field(min_length=1)

    @model_validator(mode="after")
    def _no_second_fat(self) -> CurveFile:
        if "fat" in self.muscles:
            raise ValueError("muscles: fat is the tissue between muscles; a muscle needs another name")
        return self


@dataclass(frozen=True, eq=False)
class PlacedCurve:
    """A curve as points with tissue values, frames and rates.

    Points (s, 3) are in mm, tissue is (s,), frames are (s, 3, 3) with the axes in rows, and rates are (s, 3)
    along these rows.
    """

    points: Array
    tissue: Array
    frames: Array
    rates: Array


@dataclass(frozen=True, eq=False)
class PlacedAttachment:
    """Vertices within `reach` mm of the line through points (p, 3)."""

    points: Array
    reach: float


@dataclass(frozen=True, eq=False)
class PlacedMuscle:
    """A muscle's curves and attachments in space."""

    curves: tuple[PlacedCurve, ...]
    origins: tuple[PlacedAttachment, ...]
    insertions: tuple[PlacedAttachment, ...]
    volume: float | None
    edge_length: float | None
    fibres: Literal["gradient", "flow"]


File = TypeVar("File", bound=CurveFile)


def load_curves(path: str | Path, model: type[File] = CurveFile) -> File:  # type: ignore[assignment]
    """Read a file of curves.

    Parameters
    ----------
    path : path
        YAML file.
    model : class
        What the file has to be.

    Returns
    -------
    CurveFile
        The muscles as curves, and the fat.

    Raises
    ------
    InputError
        For the first wrong field; the text names the file and where its fields are documented.
    """
    try:
        return load_yaml(path, model)
    except InputError as error:
        raise InputError(path, error.field, error.problem, "See docs/anatomy.md") from error


def place(
    file: CurveFile, bones: Mapping[str, Surface], step: float, source: str | Path = "curves"
) -> dict[str, PlacedMuscle]:
    """Muscles of a file on given bones.

    Parameters
    ----------
    file : CurveFile
        Muscles as curves.
    bones : mapping of str to Surface
        Surfaces in mm by bone.
    step : float
        Largest distance in mm between samples of a curve.
    source : path
        The file, for messages.

    Returns
    -------
    mapping of str to PlacedMuscle
        Curves and attachments in mm by muscle.

    Raises
    ------
    InputError
        For a point on a bone that does not exist, or whose direction misses the bone.
    """
    return {
        name: _placed_muscle(muscle, _Places(bones, np.array(file.distal), source, f"muscles.{name}"), step)
        for name, muscle in file.muscles.items()
    }


@dataclass(frozen=True)
class _Places:
    """Finds the points of one muscle; its errors name the point that does not exist."""

    bones: Mapping[str, Surface]
    distal: Array
    source: str | Path
    field: str

    def find(self, place: CurvePlace, field: str) -> Array:
        if place.bone is None:
            return np.array(place.at)
        field = f"{self.field}.{field}"
        if place.bone not in self.bones:
            known = ", ".join(sorted(self.bones))
            raise InputError(
                self.source, f"{field}.bone", f"{place.bone!r} is no bone", f"The bones are {known}"
            )
        surface = self.bones[place.bone]
        axis, start, end = long_axis(surface, self.distal)
        direction = np.array(place.towards) / np.linalg.norm(np.array(place.towards))
        origin = start + place.along * (end - start)
        _, hits = ray_hits(surface, origin, direction)
        if not len(hits):
            problem = (
                f"the ray from {place.bone}'s axis at {place.along:g} towards {place.towards} misses the bone"
            )
            raise InputError(self.source, field, problem, "Move `along` inwards or change `towards`")
        return np.asarray(origin + (hits.max() + place.height) * direction)


def locate(
    places: Sequence[CurvePlace], bones: Mapping[str, Surface], distal: Vector, source: str | Path, field: str
) -> Array:
    """Points of places on given bones.

    Parameters
    ----------
    places : sequence of CurvePlace
        Coordinates, or places on bones.
    bones : mapping of str to Surface
        Surfaces in mm by bone.
    distal : sequence of float
        Rough direction (3,) of the bones' distal ends.
    source : path
        The file of the places, for messages.
    field : str
        The field of the places, for messages.

    Returns
    -------
    array (n, 3)
        Points in mm.

    Raises
    ------
    InputError
        For a bone that does not exist, or that the direction of a place misses.
    """
    finder = _Places(bones, np.array(distal), source, field)
    return np.array([finder.find(p, f"points.{i}") for i, p in enumerate(places)])


def sunken(
    points: Sequence[ControlPoint],
    bones: Mapping[str, Surface],
    distal: Vector,
    source: str | Path,
    field: str,
) -> Array:
    """How deep a curve runs inside a bone between two points on its surface.

    Parameters
    ----------
    points : sequence of ControlPoint
        A curve's points.
    bones : mapping of str to Surface
        Closed surfaces in mm by bone.
    distal : sequence of float
        Rough direction (3,) of the bones' distal ends.
    source : path
        The file of the curve, for messages.
    field : str
        The field of the curve, for messages.

    Returns
    -------
    array (n - 1,)
        Largest depth in mm after each of n points, zero where this point and the next are not on one bone.
    """
    knots, spline = catmull_rom(locate(points, bones, distal, source, field))
    depths = np.zeros(len(points) - 1)
    for i, (before, after) in enumerate(pairwise(points)):
        if before.bone is not None and before.bone == after.bone:
            between = spline(np.linspace(knots[i], knots[i + 1], MEASURED))
            depths[i] = -min(Distance(bones[before.bone]).signed(between)[0].min(), 0.0)
    return depths


def long_axis(surface: Surface, distal: Array) -> tuple[Array, Array, Array]:
    """Unit long axis (3,) of a bone, turned to the side of `distal`, and its two ends (3,) on the axis."""
    areas: Array = surface.triangle_areas()
    centres = surface.vertices[surface.triangles].mean(axis=1)
    middle = areas @ centres / areas.sum()
    spread = (centres - middle).T @ ((centres - middle) * areas[:, None])
    axis = np.linalg.eigh(spread)[1][:, -1]
    axis = axis if axis @ distal >= 0 else -axis
    reach = (surface.vertices - middle) @ axis
    return axis, middle + reach.min() * axis, middle + reach.max() * axis


def ray_hits(surface: Surface, origin: Array, direction: Array) -> tuple[IntArray, Array]:
    """Triangles (h,) that a ray meets, and distances (h,) along it (Moeller and Trumbore 1997)."""
    a, b, c = np.moveaxis(surface.vertices[surface.triangles], 1, 0)
    across = np.cross(direction, c - a)
    determinant = np.einsum("ki,ki->k", b - a, across)
    determinant = np.where(np.abs(determinant) < 1e-300, np.nan, determinant)
    u = np.einsum("ki,ki->k", origin - a, across) / determinant
    lifted = np.cross(origin - a, b - a)
    v = lifted @ direction / determinant
    along = np.einsum("ki,ki->k", c - a, lifted) / determinant
    hit = np.flatnonzero((u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (along >= -1e-9))
    return hit, along[hit]


def _placed_muscle(muscle: MuscleCurves, places: _Places, step: float) -> PlacedMuscle:
    curves = tuple(_placed_curve(curve, places, f"curves.{i}", step) for i, curve in enumerate(muscle.curves))
    ends = {
        "origin": [PlacedAttachment(c.points[:1], muscle.reach) for c in curves],
        "insertion": [PlacedAttachment(c.points[-1:], muscle.reach) for c in curves],
    }
    for i, attachment in enumerate(muscle.attachments):
        points = [places.find(p, f"attachments.{i}.points.{j}") for j, p in enumerate(attachment.points)]
        ends[attachment.end].append(PlacedAttachment(np.array(points), attachment.reach))
    return PlacedMuscle(
        curves,
        tuple(ends["origin"]),
        tuple(ends["insertion"]),
        muscle.volume,
        muscle.edge_length,
        muscle.fibres,
    )


def _placed_curve(curve: Curve, places: _Places, field: str, step: float) -> PlacedCurve:
    control = np.array([places.find(p, f"{field}.points.{i}") for i, p in enumerate(curve.points)])
    gaps = np.linalg.norm(np.diff(control, axis=0), axis=1)
    if (gaps < 1e-6).any():
        first = int(np.argmin(gaps))
        problem = f"points {first} and {first + 1} are at the same place"
        raise InputError(places.source, f"{places.field}.{field}.points", problem, "Remove one of them")
    knots, spline = catmull_rom(control)
    count = max(int(np.ceil(arclength(spline(np.linspace(0, knots[-1], MEASURED)))[-1] / step)) + 1, 3)
    fine = np.linspace(0, knots[-1], FINER * count)
    length = arclength(spline(fine))
    at = np.interp(np.linspace(0, length[-1], count), length, fine)
    points = resample(spline(fine), count)
    tissue = PchipInterpolator(knots, [p.tissue for p in curve.points])(at)
    spread = np.exp(PchipInterpolator(knots, np.log([p.spread for p in curve.points]))(at))
    normal = np.array(curve.normal) if curve.normal is not None else _any_normal(points)
    if np.linalg.norm(np.cross(normal, tangents(points)[0])) < PARALLEL * np.linalg.norm(normal):
        raise InputError(
            places.source,
            f"{places.field}.{field}.normal",
            "runs along the curve or is zero",
            "Choose another",
        )
    rates = np.column_stack([np.ones(count), spread])
    return PlacedCurve(points, tissue, bishop_frames(points, normal), rates)


def catmull_rom(points: Array) -> tuple[Array, CubicHermiteSpline]:
    """Centripetal knots (n,) and the Catmull-Rom spline through points (n, 3): no loops, no overshoot."""
    knots = np.concatenate([[0.0], np.cumsum(np.sqrt(np.linalg.norm(np.diff(points, axis=0), axis=1)))])
    step = np.diff(knots)[:, None]
    slope = np.diff(points, axis=0) / step
    inner = (step[1:] * slope[:-1] + step[:-1] * slope[1:]) / (step[1:] + step[:-1])
    if len(points) == 2:
        return knots, CubicHermiteSpline(knots, points, np.concatenate([slope, slope]))
    first, last = 1.5 * slope[0] - 0.5 * inner[0], 1.5 * slope[-1] - 0.5 * inner[-1]
    return knots, CubicHermiteSpline(knots, points, np.concatenate([[first], inner, [last]]))


def _any_normal(points: Array) -> Array:
    return np.eye(3)[np.argmin(np.abs(tangents(points)[0]))]
