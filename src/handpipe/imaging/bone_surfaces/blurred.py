"""Shells of bones that an interpolated image blurs: they look closed and dark, and lie in a wrong place."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from handpipe.imaging.volumes.resolution import acquired_voxels
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces import Surface

# An unresolved layer looks about as thick as the acquired voxels are wide, however thin it is: where the
# matrix is 0.6 of the voxels, shells of 1.0 to 1.25 mm look 1.03 to 1.08 acquired voxels thick, and bones are
# 0.24 mm off; right ones look at least 1.2 voxels thick.
UNRESOLVED = 1.15  # of the acquired voxels
INTERPOLATED = 1.1  # of the voxels, from which what was acquired is coarser than they are


def blurred_shells(
    volume: Volume, marrows: Mapping[str, Surface], wholes: Mapping[str, Surface]
) -> dict[str, str]:
    """Bones whose cortical shell is hardly thicker than the voxels that were acquired.

    Voxels of an image that the scanner has interpolated are finer than what it resolves. A thin shell is then
    blurred on both faces, and nothing in the image's brightness tells.

    Parameters
    ----------
    volume : Volume
        Image of the neutral pose.
    marrows, wholes : mapping of str to Surface
        Marrow and whole bone by name, in world mm.

    Returns
    -------
    dict of str to str
        What is doubtful, by bone; empty for an image that is not interpolated.
    """
    acquired = acquired_voxels(volume)
    coarse = acquired[acquired > INTERPOLATED * volume.spacing]
    if len(coarse) == 0:
        return {}
    width, found = float(coarse.max()), {}
    for name in marrows.keys() & wholes.keys():
        marrow, whole = marrows[name], wholes[name]
        thickness = (whole.volume() - marrow.volume()) / (0.5 * (whole.area() + marrow.area()))
        if thickness < UNRESOLVED * width:
            found[name] = (
                f"its shell looks {thickness:.1f} mm thick, hardly more than the voxels of {width:.1f} mm "
                f"that were acquired, and interpolated to {np.min(volume.spacing):.1f} mm: it may be "
                "thinner, and the bone's surface off by some of the difference"
            )
    return dict(sorted(found.items()))
