"""A template hand as files: PLY surfaces, JSON attachments and curves, and the fields of a dataset."""

from __future__ import annotations

import json
import shutil
from collections.abc import Collection, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from handpipe.anatomy.person.subject_template import MIRROR, Side, SubjectTemplate
from handpipe.anatomy.shipped.part import part_of
from handpipe.core import Array, InputError, IntArray, read_text, write_text
from handpipe.core.configuration import Dataset
from handpipe.imaging.evidence import read_markers, write_markers
from handpipe.mesh.files import read_surface, write_surface
from handpipe.mesh.surfaces import Distance, Surface

HAND = Path(__file__).with_name("hand")  # the template that is shipped
FIELDS = "fields.json"
WEB = "web"  # points so named are left out: this skin is webbed up to 0.8 of the proximal phalanges
SKIN, PLACES, POSES = "skin.ply", "places.json", "poses.csv"  # of the hand as one, which no dataset names
SIDE: Side = "right"  # of what is shipped
CURVE = 9  # points of a tendon's path
SAMPLES = 400  # of a path, where it is cut

Fields = dict[str, Any]
Attachments = Mapping[str, Mapping[str, IntArray]]


def ship(
    template: SubjectTemplate, attachments: Attachments, dataset: Dataset, folder: Path, poses: Path
) -> None:
    """Write a template hand to a folder: what `install` and `ShippedHand.load` read.

    Parameters
    ----------
    template : SubjectTemplate
        A right hand.
    attachments : mapping of str to mapping of str to array
        Vertices of each muscle's and ligament's surface that attach to a bone, by organ and bone.
    dataset : Dataset
        Of the same bones and organs: labels, and limits of joints.
    folder : path
        Replaced.
    poses : path
        Table of joint angles of some poses.

    Raises
    ------
    InputError
        For a left hand, and for one without a skin.
    """
    if template.side != SIDE:
        raise InputError(folder, "side", f"is {template.side}", f"Ship a {SIDE} hand")
    if template.skin is None:
        raise InputError(folder, "skin", "is missing", "Ship a hand with a skin")
    table = read_text(poses)
    shutil.rmtree(folder, ignore_errors=True)
    fields: Fields = {"bones": {}, "joints": {}, "muscles": {}, "ligaments": {}, "tendons": {}, "nails": {}}
    for name, surface in template.bones.items():
        path = _write_surface(folder, f"bones/{name}.ply", surface)
        fields["bones"][name] = {"label": dataset.bones[name].label, "template": path}
    axes = {joint.name: joint.axes for joint in template.joints}
    for name, joint in dataset.joints.items():
        fields["joints"][name] = {
            "parent": joint.parent,
            "child": joint.child,
            "angles": list(joint.angles),
            "limits_deg": [list(pair) for pair in joint.limits_deg or ()],
            "axis_hints": np.round(axes.get(name, np.zeros((0, 3))), 4).tolist(),
        }
    for kind, organs in (("muscles", template.muscles), ("ligaments", template.ligaments)):
        for name, organ in organs.items():
            fields[kind][name] = _write_organ(folder, f"{kind}/{name}", organ.surface, attachments[name])
    for name, tendon in template.tendons.items():
        chosen = np.linspace(0, len(tendon.path) - 1, CURVE).round().astype(int)
        path = f"tendons/{name}.mrk.json"
        write_markers(folder / path, tendon.path[chosen], kind="Curve")
        fields["tendons"][name] = {
            "bones": list(tendon.bones),
            "path": path,
            "radius": round(tendon.radius, 2),
        }
    for bone, patch in template.nail_patches().items():
        name = next(n for n, nail in dataset.nails.items() if nail.bone == bone)
        fields["nails"][name] = {
            "bone": bone,
            "surface": _write_surface(folder, f"nails/{name}.ply", patch),
        }
    write_text(folder / FIELDS, json.dumps(fields, indent=1) + "\n")
    _write_surface(folder, SKIN, template.skin)
    places = {
        "centres": {joint.name: np.round(joint.centre, 3).tolist() for joint in template.joints},
        "feature_points": {
            name: np.round(point, 3).tolist()
            for name, point in template.feature_points.items()
            if not name.startswith(WEB)
        },
        "nails": {bone: ids.tolist() for bone, ids in template.nails.items()},
    }
    write_text(folder / PLACES, json.dumps(places) + "\n")
    write_text(folder / POSES, table)


def install(
    folder: Path, side: Side = SIDE, source: Path = HAND, bones: Collection[str] | None = None
) -> Fields:
    """Copy a template hand, or a part of it, into a subject's folder.

    Parameters
    ----------
    folder : path
        Where to; made if it is not there.
    side : "right" or "left"
        A left hand is the mirror image of a right one: equal angles are mirror images of one another.
    source : path
        What `ship` wrote.
    bones : collection of str, optional
        Bones of the part; the whole hand if None.

    Returns
    -------
    dict
        `bones`, `joints`, `muscles`, `ligaments`, `tendons` and `nails` of a dataset, with paths relative to
        the folder.
    """
    fields = fields_of(side, source, bones)
    mirror = np.ones(3) if side == SIDE else MIRROR
    whole = fields_of(source=source)
    passed = {tendon["path"]: tendon["bones"] for tendon in whole["tendons"].values()}
    bone_at = cache(lambda bone: Distance(read_surface(source / whole["bones"][bone]["template"])))
    for relative in _files(fields):
        path = folder / relative
        path.parent.mkdir(parents=True, exist_ok=True)
        if relative.endswith(".ply"):
            surface = read_surface(source / relative)
            moved = surface.moved(surface.vertices * mirror)
            write_surface(path, moved if side == SIDE else moved.flipped())
        elif relative.endswith(".mrk.json"):
            points, _ = read_markers(source / relative)
            if bones is not None:
                points = _along(points, {bone: bone_at(bone) for bone in passed[relative]}, bones)
            write_markers(path, points * mirror, kind="Curve")
        else:
            shutil.copy(source / relative, path)
    return fields


def fields_of(side: Side = SIDE, source: Path = HAND, bones: Collection[str] | None = None) -> Fields:
    """A dataset's fields for a template hand, or a part of it.

    Parameters
    ----------
    side : "right" or "left"
        Axes of a left hand are those of the mirror image.
    source : path
        What `ship` wrote.
    bones : collection of str, optional
        Bones of the part; the whole hand if None.

    Returns
    -------
    dict
        As of `install`.
    """
    fields: Fields = json.loads((source / FIELDS).read_text(encoding="utf-8"))
    if bones is not None:
        fields = part_of(fields, bones, source)
    if side != SIDE:
        for joint in fields["joints"].values():
            joint["axis_hints"] = [(-np.array(axis) * MIRROR).tolist() for axis in joint["axis_hints"]]
    return fields


def _along(path: Array, passed: Mapping[str, Distance], part: Collection[str]) -> Array:
    """A tendon's path (n, 3) from its insertion while the nearest of the bones it passes is in the part."""
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    curve = CubicSpline(at, path)
    fine = np.linspace(0.0, at[-1], SAMPLES)
    nearest = np.argmin([bone.closest(curve(fine))[0] for bone in passed.values()], axis=0)
    outside = [bone not in part for bone in passed]
    cut = np.array(outside)[nearest]
    end = fine[np.argmax(cut)] if cut.any() else at[-1]
    return np.asarray(curve(np.linspace(0.0, end, CURVE)))


def _files(fields: Mapping[str, Any]) -> Iterator[str]:
    """Every relative path in a dataset's fields."""
    for value in fields.values():
        if isinstance(value, dict):
            yield from _files(value)
        elif isinstance(value, str) and value.endswith((".ply", ".json")):
            yield value


def _write_surface(folder: Path, relative: str, surface: Surface) -> str:
    (folder / relative).parent.mkdir(parents=True, exist_ok=True)
    write_surface(folder / relative, surface)
    return relative


def _write_organ(
    folder: Path, relative: str, surface: Surface, attachments: Mapping[str, IntArray]
) -> dict[str, str]:
    template = _write_surface(folder, f"{relative}.ply", surface)
    listed = {bone: ids.tolist() for bone, ids in attachments.items()}
    write_text(folder / f"{relative}.json", json.dumps(listed) + "\n")
    return {"template": template, "attachments": f"{relative}.json"}
