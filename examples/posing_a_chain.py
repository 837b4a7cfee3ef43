"""Rigid motions of a finger.

Motions of bones compose from the root outwards. A finger of three bones is bent at each of its two joints.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import RigidTransform

CENTRES = np.array([[0.0, 0.0, 0.0], [40.0, 0.0, 0.0]])  # mm
FLEXION = np.array([0.0, 1.0, 0.0])


def hinge(centre: np.ndarray, degrees: float) -> RigidTransform:
    """Rotation about the flexion axis through a centre."""
    return RigidTransform.about(centre, Rotation.from_rotvec(np.radians(degrees) * FLEXION).as_matrix())


proximal = hinge(CENTRES[0], 30.0)
middle = proximal @ hinge(CENTRES[1], 60.0)

tip = middle(np.array([[65.0, 0.0, 0.0]]))[0]
expected = 40 * np.array([np.cos(np.pi / 6), 0, -np.sin(np.pi / 6)]) + [0, 0, -25]
print("fingertip", tip.round(3))
assert np.allclose(tip, expected)
