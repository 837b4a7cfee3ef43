"""A neutral bone that lost an end is doubted by name; whole ones are not."""

import numpy as np
import pytest
import trimesh

from handpipe.core.configuration.anatomy import Joint
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.registration.neutral_bones import LENGTHS, neutral_doubts

RAY = ("metacarpal3", "proximal3", "middle3", "distal3")
JOINTS = {
    f"joint{i}": Joint(parent=a, child=b, angles=("bend",), axis_hints=((0.0, 1.0, 0.0),))
    for i, (a, b) in enumerate(zip(RAY[:-1], RAY[1:], strict=True))
}


def ray(kept=1.0, lost="proximal3", scale=1.0):
    """Ellipsoids of published lengths one after another, 2 mm apart; of one bone a share is kept."""
    marrows, start = {}, 0.0
    for name in RAY:
        length = scale * LENGTHS[name] - 1.4
        mesh = trimesh.creation.icosphere(3)
        vertices = mesh.vertices * [0.5 * length, 4.0, 4.0]
        if name == lost:
            vertices[:, 0] = np.minimum(vertices[:, 0], (kept - 0.5) * length)
        marrows[name] = Surface(vertices + [start + 0.5 * length, 0, 0], np.asarray(mesh.faces, np.int64))
        start += length + 2.0
    return marrows


def test_whole_bones_of_any_hand_are_not_doubted() -> None:
    for scale in (0.8, 1.0, 1.2):
        assert neutral_doubts(ray(scale=scale), JOINTS) == {}


def test_a_bone_without_its_end_is_named_with_what_to_draw() -> None:
    found = neutral_doubts(ray(kept=0.6), JOINTS)
    assert set(found) == {"proximal3"}
    assert "draw" in found["proximal3"]
    assert "gapes" in found["proximal3"]


def test_a_lost_tip_of_a_distal_phalanx_is_told_by_its_length() -> None:
    assert set(neutral_doubts(ray(kept=0.7, lost="distal3"), JOINTS)) == {"distal3"}


def test_the_length_of_a_bone_that_the_image_cuts_says_nothing() -> None:
    marrows = ray(kept=0.7, lost="distal3")
    assert neutral_doubts(marrows, JOINTS, cut=("distal3",)) == {}
    # Nor does it tell the hand's scale: with two bones that are cut, two remain, which are too few to judge.
    assert neutral_doubts(marrows, JOINTS, cut=("metacarpal3", "proximal3")) == {}


def test_a_gap_between_bones_that_the_hand_does_not_know_is_logged_alone(
    caplog: pytest.LogCaptureFixture,
) -> None:
    whole = ray(kept=0.6)
    names = dict(zip(RAY, ("radius", "capitate", "hamate", "ulna"), strict=True))
    marrows = {names[bone]: marrow for bone, marrow in whole.items()}
    joints = {
        name: joint.model_copy(update={"parent": names[joint.parent], "child": names[joint.child]})
        for name, joint in JOINTS.items()
    }
    assert neutral_doubts(marrows, joints) == {}
    assert "joint joint1 gapes by" in caplog.text and "capitate or hamate" in caplog.text
    assert "joint0" not in caplog.text
