"""Pose of a joint.

A hinge is fitted to the motion of a bone in four poses. The fit finds the axis, the centre and the angles.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import RigidTransform
from handpipe.skeleton.joints import fit_joint

AXIS, CENTRE = np.array([0.0, 1.0, 0.0]), np.array([10.0, 2.0, 0.0])  # mm
ANGLES = np.radians([0, 20, 45, 70])

motions = [RigidTransform.about(CENTRE, Rotation.from_rotvec(a * AXIS).as_matrix()) for a in ANGLES]
joint = fit_joint(motions, 1, np.array([[0.05, 1.0, 0.0]]), near=CENTRE + np.array([0.5, 0.0, 0.5]))
found = joint.angles_of(motions).ravel()

print("angles", np.degrees(found).round(2))
assert np.allclose(found, ANGLES, atol=1e-3)
