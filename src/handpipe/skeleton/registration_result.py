"""What a registration found, and how sure it is of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handpipe.mesh.rigid import RigidTransform

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Registration:
    """transform from neutral to the pose; rms in mm of the robust distances that it leaves.

    covariance (6, 6) of (omega, t) in rad and mm: the true transform is the found one followed by a
    rotation by omega about its image of the neutral vertices' mean and a translation by t. It knows the
    noise of the target, also where neighbours share it, not what both surfaces have wrong alike.
    """

    transform: RigidTransform
    rms: float
    covariance: Array


def rotation_uncertainty(registration: Registration) -> Array:
    """Standard deviations (3,) in deg of the rotation along its principal directions, largest first."""
    values = np.linalg.eigvalsh(registration.covariance[:3, :3])[::-1]
    return np.degrees(np.sqrt(np.maximum(values, 0)))
