"""Surfaces of placed bones, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.anatomy.placing.bone_file import BoneFile, CurveBone, CylinderBone, ShapeBone
from handpipe.anatomy.placing.templates import Library
from handpipe.anatomy.templates.curves import catmull_rom, long_axis
from handpipe.core import Array, InputError
from handpipe.mesh.contact import crossings
from handpipe.mesh.surfaces import Surface, concatenate, resample

SHORTEST = 1.0  # mm between the points of a bone
GAP = 0.1  # of a bone's share of a row that is left free between it and the next one
FINE = 400  # points by which a spline's length is measured
X = np.array([1.0, 0, 0])  # side of a template's long axis that goes to a bone's second point

PlacedBones = Mapping[str, Surface]  # by the bone's name


def place_bones(file: BoneFile, library: Library, source: str | Path) -> dict[str, Surface]:
    """Surfaces of the bones of a file.

    Parameters
    ----------
    file : BoneFile
        Bones by name.
    library : mapping of str to Surface
        Templates by name.
    source : path
        The file, for messages.

    Returns
    -------
    dict of str to Surface
        Closed surfaces in mm; bones of a row are `NAME_1`, `NAME_2`…

    Raises
    ------
    InputError
        For an unknown template, points that lie together, and two bones of one name.
    """
    found: dict[str, Surface] = {}
    for name, bone in file.bones.items():
        field = f"bones.{name}"
        if bone.template not in library:
            problem = f"{bone.template!r} is no template"
            raise InputError(source, f"{field}.template", problem, f"Take {', '.join(library)}")
        points = np.array(bone.points)
        if np.linalg.norm(np.diff(points, axis=0), axis=1).min() < SHORTEST:
            problem = f"two points are less than {SHORTEST:g} mm apart"
            raise InputError(source, f"{field}.points", problem, "Place one farther away")
        for own, surface in _surfaces(name, bone, points, library[bone.template]).items():
            if own in found:
                raise InputError(source, field, f"another bone is {own}, too", "Give it another name")
            found[own] = surface
    return found


def bone_faults(file: BoneFile, bones: PlacedBones, skin: Surface, source: str | Path) -> list[InputError]:
    """What keeps bones from being used: they lie outside of the skin, or in one another.

    Parameters
    ----------
    file : BoneFile
        Bones by name.
    bones : mapping of str to Surface
        Their surfaces in mm, of `place_bones`.
    skin : Surface
        Closed surface in mm.
    source : path
        The file, for messages.

    Returns
    -------
    list of InputError
        Faults, in the order of the bones.
    """
    faults = []
    for name, bone in bones.items():
        outside = ~skin.contains(bone.vertices)
        if outside.any():
            problem = f"{100 * outside.mean():.0f} % of it is outside the skin"
            faults.append(InputError(source, f"bones.{name}", problem, "Move its points, or make it thinner"))
    boxes = {name: bone.box for name, bone in bones.items()}
    names = list(bones)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            if not _apart(boxes[a], boxes[b]) and _meet(bones[a], bones[b]):
                problem = f"it and {b} penetrate each other"
                faults.append(InputError(source, f"bones.{a}", problem, "Move one, or make it thinner"))
    return faults


def _surfaces(
    name: str, bone: CylinderBone | CurveBone | ShapeBone, points: Array, template: Surface
) -> dict[str, Surface]:
    if isinstance(bone, ShapeBone):
        middle, end = points
        return {name: _between(template, 2 * middle - end, end, None)}
    if isinstance(bone, CylinderBone):
        return {name: _between(template, points[0], points[1], bone.radius)}
    knots, spline = catmull_rom(points)
    ends = resample(spline(np.linspace(0, knots[-1], FINE)), bone.count + 1)
    shorter = 0.5 * GAP * np.diff(ends, axis=0)
    return {
        f"{name}_{i + 1}": _between(template, ends[i] + shorter[i], ends[i + 1] - shorter[i], bone.radius)
        for i in range(bone.count)
    }


def _between(template: Surface, start: Array, end: Array, radius: float | None) -> Surface:
    """A template whose long axis goes from start (3,) to end (3,).

    Across it is scaled to a largest radius in mm, or as along.
    """
    axis, low, high = long_axis(template, X)
    along = (template.vertices - low) @ axis / ((high - low) @ axis)
    across = template.vertices - low - np.outer((template.vertices - low) @ axis, axis)
    widest = float(np.linalg.norm(across, axis=1).max())
    length, own = np.linalg.norm(end - start), np.linalg.norm(high - low)
    scale = length / own if radius is None else radius / widest
    turn, _ = Rotation.align_vectors((end - start)[None] / length, axis[None])  # the shortest
    return template.moved(start + np.outer(along, end - start) + scale * turn.apply(across))


def _apart(a: tuple[Array, Array], b: tuple[Array, Array]) -> bool:
    return bool((a[1] < b[0]).any() or (b[1] < a[0]).any())


def _meet(a: Surface, b: Surface) -> bool:
    """Whether two closed surfaces cross, or one lies in the other."""
    if a.contains(b.vertices[:1]).any() or b.contains(a.vertices[:1]).any():
        return True
    return len(crossings(concatenate([a, b]))) > len(crossings(a)) + len(crossings(b))
