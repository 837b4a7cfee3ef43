"""Distal, dorsal and radial of hands whose directions are known by construction."""

from dataclasses import replace

import five_fingers
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.joint_tree import RigJoint
from handpipe.skeleton.rig.anatomical_directions import hand_directions, middle_finger
from handpipe.skeleton.rig.rig import Rig

WITHIN = np.cos(np.radians(8))  # the fingers of the hand fan out, and their joints' axes tilt


def turned(rig: Rig, turn: RigidTransform) -> Rig:
    """The same hand, placed otherwise in the scanner."""
    joints = [
        RigJoint(
            j.name,
            j.parent,
            j.child,
            j.angles,
            j.limits,
            replace(
                j.fit,
                axes=Axes(j.fit.axes.directions @ turn.rotation.T, j.fit.axes.order),
                centre=turn(j.fit.centre),
            ),
        )
        for j in rig.joints
    ]
    surfaces = {b: s.moved(turn(s.vertices)) for b, s in rig.surfaces.items()}
    return Rig(rig.root, tuple(joints), surfaces, {})


@pytest.mark.parametrize("hand", ["right", "left"])
@pytest.mark.parametrize("turn", [[0.0, 0, 0], [1.2, -0.7, 2.0], [0.0, np.pi, 0]], ids=str)
def test_directions_are_the_hands_and_not_the_scanners(hand, turn) -> None:
    place = RigidTransform(Rotation.from_rotvec(turn).as_matrix(), np.array([100.0, -40, 7]))
    rig = turned(five_fingers.rig(residuals=False, mirrored=hand == "left"), place)
    found = hand_directions(rig, hand)
    assert found is not None
    true = place.rotation.T  # rows: where +x distal, +y radial and +z dorsal of the right hand went
    thumb = 1.0 if hand == "right" else -1.0
    assert found.distal @ true[0] > WITHIN
    assert found.radial @ (thumb * true[1]) > WITHIN
    assert found.dorsal @ true[2] > WITHIN
    axes = np.stack([found.distal, found.radial, found.dorsal])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert middle_finger(rig) == ("carpals", "proximal3", "middle3", "distal3")


def test_directions_follow_the_metacarpal() -> None:
    found = hand_directions(five_fingers.rig(residuals=False), "right")
    assert found is not None
    bend = Rotation.from_rotvec([0, 1.0, 0]).as_matrix()  # of the wrist, to the palm
    moved = found.moved({found.bone: RigidTransform(bend, np.zeros(3))})
    assert moved.distal @ [np.cos(1.0), 0, -np.sin(1.0)] > WITHIN
    assert moved.dorsal @ [np.sin(1.0), 0, np.cos(1.0)] > WITHIN
    assert found.moved({}) is found


def test_without_a_moving_joint_nothing_is_told() -> None:
    corner = Surface(np.eye(4, 3), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    still = five_fingers.rig().joints[0]
    rigid = RigJoint("stiff", "a", "b", (), np.zeros((0, 2)), still.fit)
    rig = Rig("a", (rigid,), {"a": corner, "b": corner}, {})
    assert hand_directions(rig, "right") is None
    assert middle_finger(rig) == ("a", "b")


def test_a_ball_joint_without_a_flexion_tells_no_direction() -> None:
    """Its axes are those of the image, in any order."""
    corner = Surface(np.eye(4, 3), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    known = five_fingers.rig(residuals=False).joints[0]
    angles = tuple(f"radius_lunate_{axis}" for axis in "xyz")
    fit = replace(known.fit, axes=Axes(np.eye(3), (0, 1, 2)))
    ball = RigJoint("radius_lunate", "a", "b", angles, np.tile([-1.0, 1.0], (3, 1)), fit)
    surfaces = {"a": corner, "b": corner.moved(corner.vertices + [5.0, 0, 0])}
    assert hand_directions(Rig("a", (ball,), surfaces, {}), "right") is None
    named = replace(ball, angles=("radius_lunate_flexion", *angles[1:]))
    assert hand_directions(Rig("a", (named,), surfaces, {}), "right") is not None
