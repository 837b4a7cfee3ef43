"""Starts at which nothing meets, near those that were given."""

import numpy as np
import trimesh
from tests.muscles.crossings import crossings, inside

from handpipe.mesh.surface import Surface
from handpipe.muscles.overlap import Body
from handpipe.muscles.parting import parted

NOTHING = np.zeros(0, dtype=np.int64)


def grooved_bone() -> Surface:
    """A block of 6 by 3 by 10 mm with a groove along z, 0.8 mm wide and 1.6 deep."""
    outline = np.array([[-3, -2], [3, -2], [3, 1], [0.4, 1], [0, -0.6], [-0.4, 1], [-3, 1]])
    cap = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [4, 5, 6], [4, 6, 0]])
    number = np.arange(len(outline))
    after = np.roll(number, -1)
    low, high = (np.column_stack([outline, np.full(len(outline), z)]) for z in (-5.0, 5.0))
    above = number + len(outline), after + len(outline)
    sides = [np.column_stack([number, after, above[1]]), np.column_stack([number, above[1], above[0]])]
    return Surface(np.concatenate([low, high]), np.concatenate([cap[:, ::-1], cap + len(outline), *sides]))


def test_a_muscle_leaves_a_hollow_of_a_bone_by_its_mouth():
    ball = trimesh.creation.icosphere(subdivisions=2)
    tongue = Surface(ball.vertices * [0.15, 0.9, 1.5] + [0, 0.2, 0], ball.faces)
    bone = grooved_bone()
    assert inside(tongue.vertices, bone).any()
    found = parted([Body("tongue", tongue, NOTHING)], [Body("bone", bone, NOTHING, fixed=True)])
    assert found is not None
    moved = tongue.moved(found[0])
    assert crossings(moved, bone) == 0 and crossings(bone, moved) == 0
    assert not inside(moved.vertices, bone).any()
    assert np.linalg.norm(moved.vertices - tongue.vertices, axis=1).max() < 0.5  # the groove is 0.8 wide
