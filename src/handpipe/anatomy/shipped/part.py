"""The part of a template hand that a scan shows: some bones, and all that has its place on these alone."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

from handpipe.core import InputError

FINGERS = {"thumb": "1", "index": "2", "middle": "3", "ring": "4", "little": "5"}  # last letter of bones
Fields = dict[str, Any]


def bones_of_part(fields: Fields, names: Iterable[str]) -> list[str]:
    """Bones of a part of the template hand.

    Parameters
    ----------
    fields : dict
        Fields of the whole template, of `fields_of`.
    names : iterable of str
        Bones, or fingers: thumb, index, middle, ring, little. A finger has its metacarpal.

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
        if not found:
            problem = f"{name} is neither a finger nor a bone of the template"
            raise InputError(
                "--only", "name", problem, f"Fingers: {', '.join(FINGERS)}; bones: {', '.join(whole)}"
            )
        chosen.update(found)
    bones = [b for b in whole if b in chosen]
    _require_connected(bones, fields["joints"])
    return bones


def part_of(fields: Fields, bones: Collection[str], source: Path) -> Fields:
    """Fields of a part of the template hand.

    Joints, muscles and ligaments remain if the part has all their bones. A tendon remains if the part has the
    bone of its insertion; it then runs along the part's bones.

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
        "joints": {n: j for n, j in fields["joints"].items() if {j["parent"], j["child"]} <= set(bones)},
        "muscles": {n: organ for n, organ in fields["muscles"].items() if attached(organ)},
        "ligaments": {n: organ for n, organ in fields["ligaments"].items() if attached(organ)},
        "tendons": {
            n: tendon | {"bones": [b for b in tendon["bones"] if b in bones]}
            for n, tendon in fields["tendons"].items()
            if tendon["bone"] in bones
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
