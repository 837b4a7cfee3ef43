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
RESIDUAL = 0.6  # mm
OFF, OFF_PART = 0.06, 0.20  # share of the whole area, and of that of one bone's part
SIZES = (0.6, 1.6)  # times the extent of the image's skin: forearms may be longer or shorter

ANOTHER = "Check that the scan is of this hand and in mm"
POSE = "Give the scan of this pose, or scan the hand again in its mould"


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
    joint = max(found.joint_angles, key=lambda name: found.joint_angles[name], default="")
    part = max(found.off_parts, key=lambda name: found.off_parts[name])
    if found.residual > RESIDUAL:
        problem = (
            f"is {found.residual:.2f} mm off the skin in its pose's image on average (at most {RESIDUAL:g})"
        )
        raise InputError(
            path, "fit", f"{problem}, most at {part}", f"{POSE}; {ANOTHER[0].lower()}{ANOTHER[1:]}"
        )
    if joint and found.joint_angles[joint] > ANGLE:
        problem = (
            f"fits the image of its pose only with {joint} turned by {found.joint_angles[joint]:.1f} deg"
        )
        raise InputError(path, "pose", f"{problem} (at most {ANGLE:g})", POSE)
    if found.off > OFF or found.off_parts[part] > OFF_PART:
        problem = (
            f"has {100 * found.off:.0f} % of its area more than {NEAR:g} mm off the skin in its pose's image"
        )
        problem += f", and {100 * found.off_parts[part]:.0f} % at {part}"
        limits = f"at most {100 * OFF:g} % of all and {100 * OFF_PART:g} % at a bone"
        raise InputError(path, "fit", f"{problem} ({limits})", f"{POSE}; {ANOTHER[0].lower()}{ANOTHER[1:]}")
    if abs(found.volume_ratio - 1) > VOLUME:
        problem = f"has {found.volume_ratio:.2f} times the volume of the body in its pose's image"
        problem += f" (at most {100 * VOLUME:g} % more or less)"
        raise InputError(path, "volume", problem, ANOTHER)


def _extent(surface: Surface) -> float:
    """Length in mm along the longest principal axis, whatever the frame."""
    points = surface.compact().vertices
    axis = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][0]
    return float(np.ptp(points @ axis))
