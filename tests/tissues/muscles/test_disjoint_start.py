"""Initial guesses without intersections, near the given shapes."""

from itertools import permutations

import numpy as np
import pytest
import trimesh
from tests.tissues.muscles.crossings import crossings, inside
from tests.tissues.muscles.shapes import hairpin

from handpipe.mesh.surfaces.surface import Surface
from handpipe.tissues.muscles.separation.disjoint_start import disjoint_start
from handpipe.tissues.muscles.separation.overlap import Collider

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
    found = disjoint_start(
        [Collider("tongue", tongue, NOTHING)], [Collider("bone", bone, NOTHING, fixed=True)]
    )
    assert found is not None
    moved = tongue.moved(found[0])
    assert crossings(moved, bone) == 0 and crossings(bone, moved) == 0
    assert not inside(moved.vertices, bone).any()
    assert np.linalg.norm(moved.vertices - tongue.vertices, axis=1).max() < 0.5  # the groove is 0.8 wide


def bent_sheet(radius: float) -> Surface:
    """A flat muscle of 16 by 8 by 1.6 mm, bent over an arc of a radius in mm; its hollow looks along z."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    x, y, z = (ball.vertices * [8.0, 4.0, 0.8]).T
    arc = np.column_stack([(radius - z) * np.sin(x / radius), y, radius - (radius - z) * np.cos(x / radius)])
    return Surface(arc, ball.faces)


@pytest.mark.parametrize(("radius", "side"), [(6.0, 0.05), (6.0, 0.1), (9.0, 0.05)])
def test_a_rod_through_the_hollow_of_a_bent_muscle_leaves_it_on_its_own_side(radius, side):
    """Its middle lies `side` mm out of the sheet's: drawn in to threads both still meet."""
    sheet, ball = bent_sheet(radius), trimesh.creation.icosphere(subdivisions=2)
    rod = Surface(ball.vertices * [0.7, 7.0, 0.7] + [0.3, 0.0, side], ball.faces)
    found = disjoint_start([Collider("sheet", sheet, NOTHING), Collider("rod", rod, NOTHING)], [])
    assert found is not None
    bent, straight = sheet.moved(found[0]), rod.moved(found[1])
    assert crossings(bent, straight) == 0 and crossings(straight, bent) == 0
    middle = np.abs(sheet.vertices[:, 0]) < 1
    assert straight.vertices[:, 2].mean() > bent.vertices[middle, 2].mean()
    assert np.linalg.norm(bent.vertices - sheet.vertices, axis=1).max() < 1.5  # straightened it moves by 3


def spiked_sheet(z: float, side: float, tip: float, at: float) -> Surface:
    """A flat muscle of 16 by 8 by 1 mm at z, two of whose vertices stand out by `tip` mm to one side."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    x = ball.vertices * [8.0, 4.0, 0.5]
    facing = np.flatnonzero(side * x[:, 2] > 0)
    for place in ([at, 0.0], [3.0 - at, 1.0]):
        nearest = facing[np.linalg.norm(x[facing, :2] - place, axis=1).argmin()]
        x[nearest, 2] = side * tip
    return Surface(x + [0.0, 0.0, z], ball.faces)


@pytest.mark.parametrize(("apart", "tip", "aside"), [(1.2, 2.0, 0.1), (1.5, 2.5, 0.2), (1.1, 2.0, 0.3)])
def test_corners_that_have_passed_one_another_go_back(apart, tip, aside):
    """No vertex is in the other muscle: what leads out of that which is nearest leads the corners farther."""
    below, above = spiked_sheet(0.0, 1.0, tip, 0.0), spiked_sheet(apart, -1.0, tip, aside)
    found = disjoint_start([Collider("below", below, NOTHING), Collider("above", above, NOTHING)], [])
    assert found is not None
    one, other = below.moved(found[0]), above.moved(found[1])
    assert crossings(one, other) == 0 and crossings(other, one) == 0
    assert np.linalg.norm(one.vertices - below.vertices, axis=1).max() < tip


@pytest.mark.parametrize(("cleft", "deep", "aside"), [(0.2, 0.8, 0.0), (0.2, 1.2, 1.0), (0.4, 1.2, 0.0)])
def test_a_muscle_over_the_cleft_between_two_bones_leaves_both(cleft, deep, aside):
    """Out of one bone leads into the other: wider margins about both would throw it 2 to 4 mm off."""
    block, ball = trimesh.creation.box(extents=[4.0, 12.0, 6.0]), trimesh.creation.icosphere(subdivisions=3)
    bones = [
        Collider(f"bone {side}", Surface(block.vertices + [x, 0.0, -3.0], block.faces), NOTHING, fixed=True)
        for side, x in (("left", -2.0 - 0.5 * cleft), ("right", 2.0 + 0.5 * cleft))
    ]
    muscle = Surface(ball.vertices * [2.5, 4.0, 1.5] + [aside, 0.0, 1.5 - deep], ball.faces)
    found = disjoint_start([Collider("muscle", muscle, NOTHING)], bones)
    assert found is not None
    moved = muscle.moved(found[0])
    for bone in bones:
        assert crossings(moved, bone.surface) == 0 and crossings(bone.surface, moved) == 0
        assert not inside(moved.vertices, bone.surface).any()
    assert np.linalg.norm(moved.vertices - muscle.vertices, axis=1).max() < deep + 1.0


def test_a_rod_through_the_middle_of_a_sheet_is_pushed_out_of_it():
    """Smoothed, both are threads that still meet: the way out of small depths alone finds no end."""
    fine, coarse = (trimesh.creation.icosphere(subdivisions=n) for n in (4, 3))
    sheet = Surface(fine.vertices * [18.0, 9.0, 2.5], fine.faces)
    line = coarse.vertices * [14.0, 0.9, 0.9] + [0.0, 0.3, 0.2]
    rod = Surface(line + 0.05 * line[:, :1] * [0.0, 0.0, 1.0], coarse.faces)  # it crosses the middle
    found = disjoint_start([Collider("sheet", sheet, NOTHING), Collider("rod", rod, NOTHING)], [])
    assert found is not None
    one, other = sheet.moved(found[0]), rod.moved(found[1])
    assert crossings(one, other) == 0 and crossings(other, one) == 0
    assert not inside(other.vertices, one).any()


@pytest.mark.parametrize(("radius", "deep"), [(0.9, 0.7), (1.0, 0.8)])
def test_a_leg_that_a_bone_pushes_does_not_pass_through_itself_or_the_other(radius, deep):
    """Pushed out vertex by vertex, one side of the leg passes the other."""
    muscle, sides = hairpin(radius)
    ball = trimesh.creation.icosphere(subdivisions=3)
    across = Surface(ball.vertices * [1.2, 6.0, 1.2] + [4.0, 0.0, radius + 2.0 - deep], ball.faces)
    found = disjoint_start(
        [Collider("muscle", muscle, NOTHING)], [Collider("bone", across, NOTHING, fixed=True)]
    )
    assert found is not None
    moved = muscle.moved(found[0])
    assert crossings(moved, across) == 0 and crossings(across, moved) == 0
    for one, other in permutations(sides, 2):
        assert crossings(Surface(found[0], one), Surface(found[0], other)) == 0
