"""A rig as its artifact holds it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from handpipe.skeleton.limits import angle_ranges

if TYPE_CHECKING:
    from handpipe.skeleton.rig import Rig


def rig_groups(rig: Rig) -> dict[str, Any]:
    """Nested data of a rig: joints, neutral bones and explained poses."""
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
            }
            for j in rig.joints
        },
        "surfaces": {b: {"vertices": s.vertices, "triangles": s.triangles} for b, s in rig.surfaces.items()},
        "poses": {
            name: {
                "rotation": p.root.rotation,
                "translation": p.root.translation,
                "angles": np.array([p.angles[n] for n in rig.angle_names]),
            }
            for name, p in rig.poses.items()
        },
    }


def rig_units(rig: Rig) -> dict[str, str]:
    """Units by the keys of `rig_groups`."""
    units = {f"surfaces/{b}/vertices": "mm" for b in rig.surfaces}
    for j in rig.joints:
        units |= {f"joints/{j.name}/{k}": "rad" for k in ("limits", "seen", "reference", "fitted_angles")}
        units |= {
            f"joints/{j.name}/{k}": "mm" for k in ("centre", *(["offset"] if j.fit.offset.any() else []))
        }
        units[f"joints/{j.name}/rotation_residual/coefficients"] = "rad per product of angles in rad"
        units[f"joints/{j.name}/translation_residual/coefficients"] = "mm per product of angles in rad"
    for pose in rig.poses:
        units |= {f"poses/{pose}/translation": "mm", f"poses/{pose}/angles": "rad"}
    return units
