"""A rig as its artifact holds it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from handpipe.core import Array
from handpipe.skeleton.joints.angles import Angles
from handpipe.skeleton.joints.joint_knowledge import JointKnowledge
from handpipe.skeleton.joints.joint_tree import JointTree
from handpipe.skeleton.joints.limits import angle_ranges


def rig_groups(rig: JointTree) -> dict[str, Any]:
    """Nested data of a rig: joints, neutral bones and explained poses.

    A pose's `angles` are NaN where its bones do not determine them; `assumed` then holds the values in use.
    """
    ranges = angle_ranges(rig)
    return {
        "root": rig.root,
        "joints": {
            j.name: {
                "parent": j.parent,
                "child": j.child,
                "angles": list(j.angles),
                "limits": j.limits,
                "seen": np.array([ranges[n].seen for n in j.angles]).reshape(-1, 2),
                "reference": np.array([ranges[n].reference or (np.nan, np.nan) for n in j.angles]).reshape(
                    -1, 2
                ),
                "type": j.fit.type,
                "axes": j.fit.axes.directions,
                "order": list(j.fit.axes.order),
                "centre": j.fit.centre,
                "fitted_angles": j.fit.angles,
                "rotation_residual": vars(j.fit.rotation_residual),
                "translation_residual": vars(j.fit.translation_residual),
                **({"offset": j.fit.offset} if j.fit.offset.any() else {}),
                **({"knowledge": _knowledge(j.knowledge)} if j.knowledge else {}),
            }
            for j in rig.joints
        },
        "surfaces": {b: {"vertices": s.vertices, "triangles": s.triangles} for b, s in rig.surfaces.items()},
        "poses": {
            name: {
                "rotation": p.root.rotation,
                "translation": p.root.translation,
                "angles": np.array([p.known.get(n, np.nan) for n in rig.angle_names]),
                **({"assumed": np.array([p.angles[n] for n in rig.angle_names])} if p.undetermined else {}),
            }
            for name, p in rig.poses.items()
        },
    }


def _knowledge(knowledge: JointKnowledge) -> dict[str, Any]:
    return {
        "poses": knowledge.poses,
        "axis_deviation": knowledge.axes,
        "axis_determined": knowledge.axes_told.astype(np.int8),
        "centre_deviation": knowledge.centre,
        "centre_determined": int(knowledge.centre_told),
    }


def knowledge_of_group(group: Mapping[str, Any]) -> JointKnowledge:
    """A joint's knowledge as its group holds it."""
    return JointKnowledge(
        int(group["poses"]),
        np.asarray(group["axis_deviation"], float),
        np.asarray(group["axis_determined"]).astype(bool),
        float(group["centre_deviation"]),
        bool(group["centre_determined"]),
    )


def angles_of_group(
    names: Sequence[str], angles: Array, assumed: Array | None
) -> tuple[Angles, frozenset[str]]:
    """A pose's angles and the names of those that are assumed: NaN among the given angles."""
    values = angles if assumed is None else np.where(np.isnan(angles), assumed, angles)
    found = {n: float(v) for n, v in zip(names, values, strict=True)}
    return found, frozenset(n for n, a in zip(names, angles, strict=True) if np.isnan(a))


def rig_units(rig: JointTree) -> dict[str, str]:
    """Units by the keys of `rig_groups`."""
    units = {f"surfaces/{b}/vertices": "mm" for b in rig.surfaces}
    for j in rig.joints:
        units |= {f"joints/{j.name}/{k}": "rad" for k in ("limits", "seen", "reference", "fitted_angles")}
        units |= {
            f"joints/{j.name}/{k}": "mm" for k in ("centre", *(["offset"] if j.fit.offset.any() else []))
        }
        units[f"joints/{j.name}/rotation_residual/coefficients"] = "rad per product of angles in rad"
        units[f"joints/{j.name}/translation_residual/coefficients"] = "mm per product of angles in rad"
        if j.knowledge:
            group = f"joints/{j.name}/knowledge"
            units |= {f"{group}/axis_deviation": "rad", f"{group}/centre_deviation": "mm"}
    for name, pose in rig.poses.items():
        units |= {f"poses/{name}/translation": "mm", f"poses/{name}/angles": "rad"}
        units |= {f"poses/{name}/assumed": "rad"} if pose.undetermined else {}
    return units
