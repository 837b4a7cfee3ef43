"""A file of curves while it is drawn: it may have no muscle yet. What is written reads as the same curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import Field

from handpipe.anatomy.templates.curves import (
    CurveFile,
    CurvePlace,
    MuscleCurves,
    catmull_rom,
    load_curves,
    locate,
    long_axis,
)
from handpipe.anatomy.templates.hand import HandFile
from handpipe.core import Array, InputError, write_text
from handpipe.core.configuration import Name, Vector
from handpipe.mesh.surfaces import Distance, Surface

HEADING = "# Curves of muscles, written by handpipe curves. docs/anatomy.md explains the fields.\n"
DIGITS = 4  # of places along bones and of directions
MILLIMETRE_DIGITS = 3  # of heights in mm
ENDS = 0.02  # of a bone's axis at its tips, from which no place starts: a ray along a cap misses the bone
DRAWN = 12  # points of a tendon's line for each that is given
WIDTH = 110  # characters of a line


class Draft(HandFile):
    """The muscles of a template that is being drawn; ligaments, tendons and nails of a hand are kept."""

    muscles: dict[Name, MuscleCurves] = Field(default_factory=dict)  # type: ignore[assignment]


def load_draft(path: str | Path) -> Draft:
    """Read a file of curves that may have no muscle yet.

    Parameters
    ----------
    path : path
        YAML file.

    Returns
    -------
    Draft
        Muscles as curves, and the fat.

    Raises
    ------
    InputError
        For the first wrong field, as `load_curves`.
    """
    return load_curves(path, Draft)


def write_curves(path: str | Path, file: CurveFile) -> None:
    """Write a file of curves, atomically; `load_curves` reads the same curves.

    Parameters
    ----------
    path : path
        File to be written.
    file : CurveFile
        Muscles as curves, and the fat. Fields that were not given are not written.

    Raises
    ------
    InputError
        For a draft without a muscle.
    """
    if not file.muscles:
        raise InputError(path, "muscles", "there is none to be written", "Draw a muscle first")
    write_text(
        path, HEADING + yaml.dump(_flowing(content_of(file)), Dumper=_Dumper, sort_keys=False, width=WIDTH)
    )


def content_of(file: CurveFile) -> dict[str, Any]:
    """The fields of a file that were given, as JSON has them.

    Parameters
    ----------
    file : CurveFile
        Muscles as curves.

    Returns
    -------
    dict
        Validates as the same file.
    """
    content: dict[str, Any] = file.model_dump(mode="json", exclude_unset=True)
    return content


def place_on_bone(
    point: Array, bones: Mapping[str, Surface], distal: Vector, source: str | Path, bone: str | None = None
) -> CurvePlace:
    """The place on a bone's surface nearest to a point, as files of curves state it.

    Parameters
    ----------
    point : array (3,)
        Point in mm.
    bones : mapping of str to Surface
        Surfaces in mm by bone.
    distal : sequence of float
        Rough direction (3,) of the bones' distal ends.
    source : path
        The file, for messages.
    bone : str, optional
        The bone; the nearest one by default.

    Returns
    -------
    CurvePlace
        On the bone, its numbers rounded; in mm where no ray from the bone's axis meets the point.

    Raises
    ------
    InputError
        For a bone that does not exist.
    """
    if bone is not None and bone not in bones:
        raise InputError(source, "bone", f"{bone!r} is no bone", f"The bones are {', '.join(sorted(bones))}")
    found = {name: Distance(bones[name]).closest(point[None]) for name in ([bone] if bone else bones)}
    name = min(found, key=lambda n: found[n][0][0])
    place = found[name][2][0]
    axis, start, end = long_axis(bones[name], np.array(distal))
    along = float(np.clip((place - start) @ axis / ((end - start) @ axis), ENDS, 1 - ENDS))
    along = round(along, DIGITS)
    away = place - (start + along * (end - start))
    towards = np.round(away / np.linalg.norm(away), DIGITS)
    on_bone = {"bone": name, "along": along, "towards": tuple(towards.tolist())}
    try:
        surface = locate([CurvePlace.model_validate(on_bone)], bones, distal, source, "place")[0]
    except InputError:  # the rounded ray passes the bone's edge
        return CurvePlace.model_validate({"at": tuple(place.tolist())})
    height = round(float((place - surface) @ towards), MILLIMETRE_DIGITS) + 0.0
    return CurvePlace.model_validate(on_bone | ({"height": height} if height else {}))


def points_of(
    file: CurveFile, bones: Mapping[str, Surface], source: str | Path
) -> dict[str, dict[str, list[list[list[float]]]]]:
    """Where the points of curves and attachments are.

    Parameters
    ----------
    file : CurveFile
        Muscles as curves.
    bones : mapping of str to Surface
        Surfaces in mm by bone.
    source : path
        The file, for messages.

    Returns
    -------
    dict
        By muscle, `curves` and `attachments`: of each the points in mm.

    Raises
    ------
    InputError
        As `locate`.
    """

    def places(points: Sequence[CurvePlace], field: str) -> list[list[float]]:
        found: list[list[float]] = locate(points, bones, file.distal, source, field).tolist()
        return found

    return {
        name: {
            "curves": [places(c.points, f"muscles.{name}") for c in muscle.curves],
            "attachments": [places(a.points, f"muscles.{name}") for a in muscle.attachments],
        }
        for name, muscle in file.muscles.items()
    }


def tendon_lines(file: HandFile, bones: Mapping[str, Surface], source: str | Path) -> dict[str, Array]:
    """Middle lines of a file's tendons.

    Parameters
    ----------
    file : HandFile
        Tendons, each through points.
    bones : mapping of str to Surface
        Surfaces in mm by bone.
    source : path
        The file, for messages.

    Returns
    -------
    dict of str to array (q, 3)
        Points in mm of the spline through each tendon's points, from its insertion.

    Raises
    ------
    InputError
        As `locate`.
    """
    found = {}
    for name, tendon in file.tendons.items():
        points = locate(tendon.points, bones, file.distal, source, f"tendons.{name}")
        knots, spline = catmull_rom(points)
        found[name] = np.asarray(spline(np.linspace(0, knots[-1], DRAWN * len(points))))
    return found


class _Flow(dict):  # type: ignore[type-arg]
    """A mapping that is written on one line."""


class _Dumper(yaml.SafeDumper):
    """Lists of numbers and points on one line each, as people write them."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _list(dumper: yaml.SafeDumper, data: list[Any]) -> yaml.Node:
    flow = all(isinstance(x, int | float) for x in data)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=flow)


def _flow(dumper: yaml.SafeDumper, data: _Flow) -> yaml.Node:
    return dumper.represent_mapping("tag:yaml.org,2002:map", data.items(), flow_style=True)


_Dumper.add_representer(list, _list)
_Dumper.add_representer(_Flow, _flow)


def _flowing(content: Any) -> Any:
    """The same content, the points of curves and attachments as mappings on one line."""
    if isinstance(content, list):
        return [_flowing(x) for x in content]
    if not isinstance(content, dict):
        return content
    return {k: [_Flow(p) for p in v] if k == "points" else _flowing(v) for k, v in content.items()}
