"""From a file of points to a folder with a hand that moves."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from handpipe.anatomy.person import (
    SubjectTemplate,
    feature_points,
    lengths_of,
    person_of_photograph,
    person_of_points,
    read_photograph,
)
from handpipe.anatomy.shipped import ShippedHand
from handpipe.cli.own_files import written_anew
from handpipe.cli.person.played_hand import PlayedHand
from handpipe.cli.person.where import finger_words
from handpipe.core import InputError
from handpipe.hand import FINGERS

PAGE = "player.html"
OWNER = "handpipe photograph"  # of what is written
TABLE, SLICER = ".csv", ".mrk.json"  # endings of points in 3D
Side = Literal["right", "left"]
View = Literal["back", "palm"]


@dataclass(frozen=True)
class Asked:
    """What is to be made of points.

    Parameters
    ----------
    points : Path
        Points in a photograph (JSON or YAML), or in 3D (CSV or .mrk.json).
    folder : Path
        Where to; made if it is not there.
    hand : str, optional
        "right" or "left"; by default what the file of a photograph's points says, else right.
    view : str, optional
        Side of the hand in the photograph, "back" or "palm"; by default what the file says.
    motions : sequence of Path
        Motions to be written as glTF at L2.
    """

    points: Path
    folder: Path
    hand: Side | None = None
    view: View | None = None
    motions: Sequence[Path] = ()


@dataclass(frozen=True)
class Made:
    """What was made of points.

    Parameters
    ----------
    files : tuple of Path
        Everything that was written; the page that moves the hand comes first.
    said : tuple of str
        Sizes and times, a line each.
    """

    files: tuple[Path, ...]
    said: tuple[str, ...]


def make(asked: Asked) -> Made:
    """Write a hand that moves, from points in a photograph or in 3D; files appear when all are complete.

    Files of an earlier hand in the folder are replaced, and its motions are removed.

    Parameters
    ----------
    asked : Asked
        Points, and where to.

    Returns
    -------
    Made
        Files and figures.

    Raises
    ------
    InputError
        For points of which no hand can be made, and motions that do not suit the hand.
    """
    begin = time.perf_counter()
    shipped, person, lines = _person(asked)
    hand = PlayedHand.of(shipped, person)
    lines += _lengths(shipped.template, person)
    moving = time.perf_counter()
    with written_anew(asked.folder, OWNER) as made:
        files = _written(hand, asked, made)
        lines.append(f"seconds from points to the hand {moving - begin:.1f}")
        lines.append(f"seconds from points to the page {files.pop(PAGE) - begin:.1f}")
        lines += [f"seconds of {name} {seconds:.1f}" for name, seconds in files.items()]
        names = sorted((path.name for path in made.iterdir()), key=lambda name: name != PAGE)
    return Made(tuple(asked.folder / name for name in names), tuple(lines))


def _person(asked: Asked) -> tuple[ShippedHand, SubjectTemplate, list[str]]:
    """The shipped hand of the right side, the person's template, and what the fit says of itself."""
    points = asked.points
    if points.name.lower().endswith((TABLE, SLICER)):
        if asked.view is not None:
            problem = "has no meaning for points in 3D"
            raise InputError(points, "--view", problem, "Leave it out")
        read = feature_points.read_table if points.name.lower().endswith(TABLE) else feature_points.read
        shipped = ShippedHand.load(asked.hand or "right")
        return shipped, person_of_points(shipped.template, read(points), origin=points), []
    given = {name: value for name in ("hand", "view") if (value := getattr(asked, name)) is not None}
    photograph = read_photograph(points).model_copy(update=given)
    shipped = ShippedHand.load(photograph.hand)
    flat = PlayedHand.of(shipped, shipped.template).flat
    person, lifted = person_of_photograph(shipped.template, photograph, flat, points)
    shown = f"{len(lifted.points)} points; {lifted.residual:.1f} mm from the template's in the plane"
    return shipped, person, [f"{shown}, after alignment and one scale"]


def _lengths(template: SubjectTemplate, person: SubjectTemplate) -> list[str]:
    """Lengths of the phalanges of each finger together."""
    own, found = lengths_of(template), lengths_of(person)
    lines = []
    for finger, ray in FINGERS.items():
        bones = [bone for bone in own if bone.endswith(ray) and not bone.startswith("metacarpal")]
        lengths = [sum(some[bone] for bone in bones) for some in (own, found)]
        bones_of = f"bones of the {finger_words(finger)}"
        lines.append(f"{bones_of} {lengths[1]:.0f} mm; of the template {lengths[0]:.0f} mm")
    return lines


def _written(hand: PlayedHand, asked: Asked, folder: Path) -> dict[str, float]:
    """Write all files; the time at which the page was there, and seconds of each motion."""
    hand.write_page(folder / PAGE, asked.folder.resolve().name)
    found = {PAGE: time.perf_counter()}
    for motion in asked.motions:
        begin, name = time.perf_counter(), f"{motion.stem}.glb"
        hand.write_motion(folder / name, motion)
        found[name] = time.perf_counter() - begin
    inputs = [asked.points]
    hand.template.save(folder / "hand.h5", inputs)
    hand.rig.save(folder / "rig.h5", inputs)
    hand.skin.save(folder / "skin.h5", inputs)
    hand.learned.save(folder / "levels.h5", inputs)
    return found
