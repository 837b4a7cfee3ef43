"""A pose that the page asks for, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handpipe.anatomy.bending import AXES, Bend, ProposedJoint
from handpipe.cli.muscle_curves.given import given_json, given_vector
from handpipe.core import InputError

WIDEST = 120.0  # deg, either way
MOST_SHORTENED = 40.0  # per cent of a muscle's length (Wang 2021 §6.1.3)


@dataclass(frozen=True, eq=False)
class AskedPose:
    """A bend, the joints between what moves and what stays, and a name of the pose for files."""

    bend: Bend
    pairs: tuple[tuple[str, str], ...]
    name: str


def asked_pose(
    target: Path, content: bytes, joints: Mapping[str, ProposedJoint], muscles: tuple[str, ...]
) -> AskedPose:
    """The pose that JSON of the page asks for.

    Parameters
    ----------
    target : path
        File of the curves, for messages.
    content : bytes
        JSON: `bone`, `angle` in degrees; optional `axis` (one of `AXES`), `centre` in mm, `moving` (list of
        bones), `muscle` and `shortening` in per cent.
    joints : mapping of str to ProposedJoint
        Of all bones that can move.
    muscles : tuple of str
        Muscles of the mesh.

    Returns
    -------
    AskedPose

    Raises
    ------
    InputError
        For the first field that is wrong.
    """
    given = given_json(target, content)
    if not isinstance(given, dict):
        raise InputError(target, "pose", "is no object", "Load the page again")
    if not joints:
        raise InputError(target, "pose.bone", "there is one bone, and a joint needs two", "Give --bones")
    bone = _one_of(target, "bone", given.get("bone"), tuple(joints))
    joint, axis = joints[bone], _one_of(target, "axis", given.get("axis", AXES[0]), AXES)
    moving = _moving(target, given.get("moving"), bone, joints)
    angle = _number(target, "angle", given.get("angle"), -WIDEST, WIDEST)
    shortening = _number(target, "shortening", given.get("shortening", 0.0), 0.0, MOST_SHORTENED)
    muscle = given.get("muscle") or None
    if muscle is not None:
        _one_of(target, "muscle", muscle, muscles)
    elif shortening:
        raise InputError(target, "pose.muscle", "is not chosen", "Choose the muscle that contracts")
    centre = joint.centre
    if given.get("centre") is not None:
        centre = given_vector(target, "pose.centre", given["centre"])
    parts = [bone, axis, f"{angle:g}"] + ([f"{muscle}-{shortening:g}"] if muscle and shortening else [])
    bend = Bend(
        moving,
        centre,
        joint.axes[axis],
        float(np.radians(angle)),
        {muscle: shortening / 100} if muscle and shortening else {},
    )
    cut = ((j.parent, name) for name, j in joints.items() if (name in moving) != (j.parent in moving))
    return AskedPose(bend, tuple(cut), "-".join(parts))


def _moving(target: Path, given: Any, bone: str, joints: Mapping[str, ProposedJoint]) -> tuple[str, ...]:
    """Bones that move: those beyond the joint, or those that the person marked."""
    if given is None:
        return joints[bone].moving
    if not isinstance(given, list):
        raise InputError(target, "pose.moving", "is no list of bones", "Load the page again")
    known = (*joints, *(j.parent for j in joints.values()))
    found = dict.fromkeys([bone, *(_one_of(target, "moving", name, known) for name in given)])
    if joints[bone].parent in found:
        problem = f"{joints[bone].parent} carries {bone}, and moves with it"
        raise InputError(target, "pose.moving", problem, "Leave it unmarked")
    return tuple(found)


def _one_of(target: Path, field: str, given: Any, known: tuple[str, ...]) -> str:
    if given not in known:
        choice = f"Choose one of {', '.join(dict.fromkeys(known))}"
        raise InputError(target, f"pose.{field}", f"{given!r} is unknown", choice)
    return str(given)


def _number(target: Path, field: str, given: Any, least: float, most: float) -> float:
    number = isinstance(given, int | float) and not isinstance(given, bool) and math.isfinite(given)
    if not number or not least <= given <= most:
        problem = f"{given} is no number from {least:g} to {most:g}"
        raise InputError(target, f"pose.{field}", problem, "Give one in this range")
    return float(given)
