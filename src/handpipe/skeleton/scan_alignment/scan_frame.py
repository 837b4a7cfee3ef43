"""Whether a scan lies in the frame of its pose's volume, before anything of the pose is built."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handpipe.core import RigidTransform
from handpipe.imaging.skin import skin_of_volume
from handpipe.imaging.volumes import Foreground, Volume, fits_clearly
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.scan_alignment.image_skin import uncut
from handpipe.skeleton.scan_alignment.rigid_start import rigid_start


@dataclass(frozen=True)
class ScanPlace:
    """How well a scan fits the body in its pose's volume, as it is and once moved.

    Parameters
    ----------
    agreement : float
        Dice coefficient of the scan's inside and the body.
    moved : float
        The same after the best rigid motion.
    shift : float
        mm by which that motion moves the scan's middle.
    turn : float
        deg of that motion.
    """

    agreement: float
    moved: float
    shift: float
    turn: float

    @property
    def own_frame(self) -> bool:
        """Whether the scan shows this body, but elsewhere."""
        return not fits_clearly(self.agreement) and fits_clearly(self.moved, self.agreement)


def place_of_scan(scan: Surface, volume: Volume) -> ScanPlace:
    """Compare a scan with the body in a volume, where it is and where it fits best.

    Parameters
    ----------
    scan : Surface
        Skin in mm, closed or with holes that are closed.
    volume : Volume
        Image of the same pose, with air around the body.

    Returns
    -------
    ScanPlace
        Without a motion where the scan fits as it is.

    Raises
    ------
    InputError
        Where the volume shows no skin.
    """
    scan = scan if scan.volume() > 0 else scan.flipped()
    body = Foreground.threshold(volume)
    agreement = body.agreement(scan)
    if fits_clearly(agreement):
        return ScanPlace(agreement, agreement, 0.0, 0.0)
    skin = skin_of_volume(volume)
    motion = rigid_start(scan, skin.closed, uncut(skin))
    moved = scan.moved(motion(scan.vertices))
    shift = np.linalg.norm(moved.vertices.mean(axis=0) - scan.vertices.mean(axis=0))
    return ScanPlace(agreement, body.agreement(moved), float(shift), _degrees(motion))


def _degrees(motion: RigidTransform) -> float:
    return float(np.degrees(np.linalg.norm(motion.rotation_vector())))
