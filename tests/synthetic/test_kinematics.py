"""The phantoms' kinematics."""

import numpy as np
import pytest

from handpipe.core.rigid import RigidTransform
from handpipe.synthetic.geometry.kinematics import Posture, ramp, smoothstep
from handpipe.synthetic.phantom.phantom_bones import joints

ANGLES = {"MP2_flexion": 0.7, "MP2_abduction": -0.2, "PIP2_flexion": 1.1, "DIP2_flexion": 0.5}


def posture(angles: dict[str, float]) -> Posture:
    return Posture(joints(), angles, RigidTransform.identity())


def test_zero_angles_are_neutral():
    for transform in posture(dict.fromkeys(ANGLES, 0.0)).transforms().values():
        np.testing.assert_allclose(transform.rotation, np.eye(3), atol=1e-14)
        np.testing.assert_allclose(transform.translation, 0.0, atol=1e-12)


def test_a_whole_share_of_every_joint_is_the_distal_bone():
    bent = posture(ANGLES)
    points = np.random.default_rng(0).uniform(-20, 150, (30, 3))
    ones = {joint.name: np.ones(30) for joint in bent.joints}
    np.testing.assert_allclose(bent.bend(points, ones), bent.transforms()["distal2"](points), atol=1e-10)


def test_flexion_bends_to_the_palm_and_abduction_to_the_thumb():
    tip = np.array([[150.0, 0.0, 0.0]])
    zero = dict.fromkeys(ANGLES, 0.0)
    for name in ("MP2_flexion", "PIP2_flexion", "DIP2_flexion"):
        assert posture({**zero, name: 0.5}).transforms()["distal2"](tip)[0, 2] < -5.0
    assert posture({**zero, "MP2_abduction": 0.2}).transforms()["distal2"](tip)[0, 1] > 5.0


def test_residual_motion_is_small_and_known():
    """Half a right angle of flexion differs from the pure hinge by the joint's residual alone."""
    for joint in joints():
        angles = dict.fromkeys(joint.angles, 0.0) | {joint.angles[0]: np.pi / 4}
        hinge = RigidTransform.about(joint.centre, _rotation(joint.axes[0] * np.pi / 4))
        rest = hinge.inverse() @ joint.transform(angles)
        assert np.degrees(np.linalg.norm(rest.rotation_vector())) == pytest.approx(
            np.degrees(np.linalg.norm(joint.residual_rotation))
        )
        assert 0.5 < np.degrees(np.linalg.norm(rest.rotation_vector())) <= 2.0
        moved = np.linalg.norm(joint.transform(angles)(joint.centre[None]) - joint.centre)
        assert moved == pytest.approx(np.linalg.norm(joint.residual_translation))
        assert 0.1 < moved <= 0.6


def _rotation(vector: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(vector).as_matrix()


@pytest.mark.parametrize("step", [ramp, smoothstep])
def test_steps_rise_smoothly_from_0_to_1(step):
    x = np.linspace(1.0, 6.0, 2001)
    y = step(x, 2.0, 5.0)
    assert y[0] == 0.0 and y[-1] == 1.0
    slope = np.diff(y) / np.diff(x)
    assert slope.min() >= -1e-12
    assert np.abs(np.diff(slope)).max() < 0.01
