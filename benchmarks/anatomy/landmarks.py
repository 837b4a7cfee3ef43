"""Landmarks of a hand that no feature point is: centres of joints, ends of bones, carpals."""

from __future__ import annotations

import numpy as np

from handpipe.anatomy.person import SubjectTemplate
from handpipe.anatomy.person.bony_points import away_from
from handpipe.core import Array
from handpipe.mesh.surfaces import Surface, sample_points

CARPALS = ("trapezium", "trapezoid", "capitate", "hamate")
FOREARM = ("radius", "ulna")
END = 0.1  # of a bone's length, whose surface's middle is the bone's end
SAMPLES = 4000  # points a bone: vertices would weigh where a mesh is fine


def landmarks(template: SubjectTemplate) -> dict[str, Array]:
    """Points (3,) in mm by name: `centre JOINT`, `base BONE`, `head BONE`, `middle CARPAL`.

    The wrist's centre is left out, and the tips of distal phalanges: feature points lie on them.
    """
    joints = [joint for joint in template.joints if joint.child not in FOREARM]
    found = {f"centre {joint.name}": joint.centre for joint in joints}
    for name in [n for n in template.bones if n not in CARPALS + FOREARM]:
        outwards = [joint.centre for joint in joints if joint.parent == name]
        inwards = [joint.centre for joint in joints if joint.child == name]
        axis = (
            away_from(template.bones[name], inwards[0])
            if inwards
            else -away_from(template.bones[name], outwards[0])
        )
        base, head = _ends(template.bones[name], axis)
        found[f"base {name}"] = base
        if outwards:
            found[f"head {name}"] = head
    return found | {f"middle {name}": template.bones[name].centroid() for name in CARPALS}


def basal(name: str) -> bool:
    """Whether a landmark lies between wrist and metacarpals' bases, where no feature point is."""
    kind, place = name.split()
    return (
        kind == "middle"
        or name.startswith("base metacarpal")
        or (kind == "centre" and place[:3] in ("CMC", "TM"))
    )


def finger_joint(name: str) -> bool:
    """Whether it is the centre of a joint from the knuckles outwards."""
    return name.startswith("centre ") and not basal(name)


def _ends(bone: Surface, axis: Array) -> tuple[Array, Array]:
    """The middles (3,) of the surface's first and last tenth along an axis."""
    points = sample_points(bone, SAMPLES, seed=6)
    along = points @ axis
    low, high = along.min() + END * np.ptp(along), along.max() - END * np.ptp(along)
    return points[along <= low].mean(axis=0), points[along >= high].mean(axis=0)
