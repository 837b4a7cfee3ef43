"""Scans that are of another hand or of another pose: refused, with what was measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from handpipe.core import InputError
from handpipe.imaging.volumes import unit_of
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.scan_alignment.alignment import NEAR, Alignment

# Largest figures of a scan that is taken; docs/methods.md has those of right and wrong ones.
ANGLE = 8.0  # deg, of a joint
VOLUME = 0.06  # difference, as a share
RESIDUAL = 0.5  # mm
OFF, OFF_PART = 0.05, 0.15  # share of the whole area, and of that of one bone's part
SIZES = (0.6, 1.6)  # times the extent of the image's skin: forearms may be longer or shorter

ANOTHER = "Check that the scan is of this hand and in mm"
POSE = "Give the scan of this hand in this pose, or scan it again in its mould"


def require_same_size(path: str | Path, scan: Surface, skin: Surface) -> None:
    """Check, before it is aligned, that a scan is about as large as the skin of its pose's image.

    Parameters
    ----------
    path : str or Path
        File of the scan, for messages.
    scan : Surface
        The scan in mm, in any frame.
    skin : Surface
        Skin of the image in mm.

    Raises
    ------
    InputError
        If it is not. The message names the unit in which it probably is.
    """
    size, known = _extent(scan), _extent(skin)
    if SIZES[0] < size / known < SIZES[1]:
        return
    unit = unit_of(size / known, size)
    remedy = f"It seems to be in {unit}" if unit else ANOTHER
    raise InputError(
        path, "size", f"is {size:.0f} mm long, the body in its pose's image {known:.0f} mm", remedy
    )


def limits_used(found: Alignment) -> dict[str, float]:
    """How much of each limit of a right scan an alignment uses; above 1 the scan is refused.

    Parameters
    ----------
    found : Alignment
        How a scan was aligned.

    Returns
    -------
    dict of str to float
        Share of the limit of the mean distance ("distance"), of a joint's turn ("turn"), of the area off the
        skin ("off"), of that of one bone's part ("off_part"), and of the difference in volume ("volume").
    """
    return {
        "distance": found.residual / RESIDUAL,
        "turn": max(found.joint_angles.values(), default=0.0) / ANGLE,
        "off": found.off / OFF,
        "off_part": max(found.off_parts.values()) / OFF_PART,
        "volume": abs(found.volume_ratio - 1.0) / VOLUME,
    }


def require_same_hand(path: str | Path, found: Alignment) -> None:
    """Check that an aligned scan is of the hand and the pose of the image.

    Parameters
    ----------
    path : str or Path
        File of the scan, for messages.
    found : Alignment
        How it was aligned.

    Raises
    ------
    InputError
        If a joint turned too far, the volumes differ, or too much of the scan is off the skin. The message
        names the figure and its limit.
    """
    wrong = [name for name, share in limits_used(found).items() if share > 1]
    if not wrong:
        return
    part = max(found.off_parts, key=lambda name: found.off_parts[name])
    joint = max(found.joint_angles, key=lambda name: found.joint_angles[name], default="")
    off = f"{100 * found.off:.0f} % of its area, {100 * found.off_parts[part]:.0f} % of that at {part}"
    problems = {
        "distance": (
            "fit",
            f"is {found.residual:.2f} mm off on average (at most {RESIDUAL:g}), most at {part}",
        ),
        "turn": (
            "pose",
            f"fits only with {joint} turned by {_angle(found, joint):.1f} deg (at most {ANGLE:g})",
        ),
        "off": ("fit", f"is more than {NEAR:g} mm off at {off} (at most {100 * OFF:g} %)"),
        "off_part": (
            "fit",
            f"is more than {NEAR:g} mm off at {off} (at most {100 * OFF_PART:g} % at a bone)",
        ),
        "volume": (
            "volume",
            f"has {found.volume_ratio:.2f} times its volume (at most {100 * VOLUME:g} % more or less)",
        ),
    }
    field, problem = problems[wrong[0]]
    remedy = {"turn": POSE, "volume": ANOTHER}.get(wrong[0], f"{POSE}; check, too, that it is in mm")
    raise InputError(path, field, f"compared with the skin in its pose's image, it {problem}", remedy)


def _angle(found: Alignment, joint: str) -> float:
    return found.joint_angles.get(joint, 0.0)


def _extent(surface: Surface) -> float:
    """Length in mm along the longest principal axis, whatever the frame."""
    points = surface.compact().vertices
    axis = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][0]
    return float(np.ptp(points @ axis))
