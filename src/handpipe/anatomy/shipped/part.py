"""The part of a template hand that a scan shows: some bones, and all that has its place on these alone."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

from handpipe.core import InputError

FINGERS = {"thumb": "1", "index": "2", "middle": "3", "ring": "4", "little": "5"}  # last letter of bones
WRIST = "wrist"  # distal carpals, and the metacarpals that they carry
PHALANX = ("proximal", "middle", "distal")  # names of bones beyond the metacarpals begin so
Fields = dict[str, Any]


def bones_of_part(fields: Fields, names: Iterable[str]) -> list[str]:
    """Bones of a part of the template hand.

    Parameters
    ----------
    fields : dict
        Fields of the whole template, of `fields_of`.
    names : iterable of str
        Bones, or parts: thumb, index, middle, ring, little, wrist. A finger has its metacarpal. The wrist has
        the carpals of the template, which are the distal ones, and all metacarpals.

    Returns
    -------
    list of str
        Bones in the template's order.

    Raises
    ------
    InputError
        For a name that is neither, or where joints do not connect the bones.
    """
    whole = list(fields["bones"])
    chosen: set[str] = set()
    for name in names:
        found = [b for b in whole if b == name or b.endswith(FINGERS.get(name, "no finger"))]
        if name == WRIST:
            found = [b for b in whole if not b.startswith(PHALANX)]
        if not found:
            problem = f"{name} is neither a finger nor a bone of the template"
            remedy = f"Parts: {', '.join((*FINGERS, WRIST))}; bones: {', '.join(whole)}"
            raise InputError("--only", "name", problem, f"{remedy}. For bones of other names give --joint")
        chosen.update(found)
    bones = [b for b in whole if b in chosen]
    _require_connected(bones, joints_between(bones, fields["joints"]))
    return bones


def joints_between(bones: Collection[str], joints: Fields) -> Fields:
    """Joints of a part of the template hand.

    Bones that move as one with a bone that the part lacks are fixed to one another.

    Parameters
    ----------
    bones : collection of str
        Bones of the part, in the template's order.
    joints : dict
        Joints of the whole template.

    Returns
    -------
    dict
        Joints between bones of the part.
    """
    found: Fields = {}
    first: dict[str, str] = {}  # bone of the part that stands for one that it lacks
    carried = {joint["child"]: (name, joint) for name, joint in joints.items()}
    for bone in (b for b in bones if b in carried):
        name, joint = carried[bone]
        parent = joint["parent"]
        if parent not in bones and not joint["angles"]:
            parent = first.setdefault(parent, bone)
        if parent in bones and parent != bone:
            found[name] = joint | {"parent": parent}
    return {name: found[name] for name in joints if name in found}


def part_of(fields: Fields, bones: Collection[str], source: Path) -> Fields:
    """Fields of a part of the template hand.

    Joints remain as `joints_between` says, muscles and ligaments if the part has all their bones. A tendon
    remains if the part has the bone of its insertion; it then runs along the part's bones.

    Parameters
    ----------
    fields : dict
        Fields of the whole template.
    bones : collection of str
        Bones of the part.
    source : path
        Folder of the template, with the attachments.

    Returns
    -------
    dict
        The same fields with fewer entries.
    """

    def attached(organ: dict[str, str]) -> bool:
        return set(json.loads((source / organ["attachments"]).read_text(encoding="utf-8"))) <= set(bones)

    return {
        "bones": {n: bone for n, bone in fields["bones"].items() if n in bones},
        "joints": joints_between(bones, fields["joints"]),
        "muscles": {n: organ for n, organ in fields["muscles"].items() if attached(organ)},
        "ligaments": {n: organ for n, organ in fields["ligaments"].items() if attached(organ)},
        "tendons": {
            n: tendon | {"bones": [b for b in tendon["bones"] if b in bones]}
            for n, tendon in fields["tendons"].items()
            if tendon["bones"][0] in bones
        },
        "nails": {n: nail for n, nail in fields["nails"].items() if nail["bone"] in bones},
    }


def _require_connected(bones: list[str], joints: Fields) -> None:
    reached, pairs = {bones[0]}, [{j["parent"], j["child"]} for j in joints.values()]
    for _ in bones:
        reached |= {b for pair in pairs if pair & reached and pair <= set(bones) for b in pair}
    apart = [b for b in bones if b not in reached]
    if apart:
        problem = f"no joint connects {bones[0]} to {', '.join(apart)}"
        raise InputError("--only", "bones", problem, "Add the bones between, as hamate or metacarpal3")
