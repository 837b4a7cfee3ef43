"""A skin around the phantom's bones: outside of all of them, smooth, with fingers of its own."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from tests.fem.bodies import sphere

from handpipe.mesh.generation.implicit import Grid
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface
from handpipe.synthetic.phantom import phantom_hand
from handpipe.synthetic.template_hands import real_skin
from handpipe.synthetic.template_hands.real_skin import SPACING, Closing, closed, occupied, skin_around

WRIST = -20.0


@pytest.fixture(scope="module")
def bones():
    return {name: Surface(*bone) for name, bone in phantom_hand.hand().bones.items()}


@pytest.fixture(scope="module")
def skin(bones):
    return skin_around([], bones, phantom_hand.layout(), WRIST, 4.0)


def test_it_is_one_closed_surface_around_the_bones(skin, bones):
    assert skin.is_closed() and len(skin.components()) == 1 and skin.volume() > 0
    points = np.concatenate([bone.vertices for bone in bones.values()])
    points = points[points[:, 0] > WRIST + 5]
    assert Distance(skin).signed(points)[0].max() < -1.5
    assert skin.vertices[:, 0].min() == pytest.approx(WRIST, abs=1.0)


def test_fingers_stand_apart(skin, bones):
    """Half-way between two middle phalanges is outside, between two metacarpals inside."""
    solid = Distance(skin)
    for ray in (2, 3, 4):
        for kind, side in (("middle", 1), ("metacarpal", -1)):
            one, other = (bones[f"{kind}{r}"].vertices for r in (ray, ray + 1))
            distance, nearest = cKDTree(other).query(one)
            middle = (one[distance.argmin()] + other[nearest[distance.argmin()]]) / 2
            assert side * solid.signed(middle[None])[0][0] > 0, (kind, ray)


def test_a_closing_fills_what_is_narrow():
    """A slit of 4 mm between two blocks is filled, one of 20 mm is not; elsewhere it is thicker by 2 mm."""
    x = SPACING * np.arange(100)
    for gap, within in ((4.0, True), (20.0, False)):
        filled = np.zeros((100, 40, 40), dtype=bool)
        blocks = (np.abs(x - 40) > gap / 2) & (np.abs(x - 40) < 25)
        filled[blocks, 15:25, 15:25] = True
        field = closed(filled, Closing(7.0, 2.0))
        assert (field[50, 20, 20] < 0) is np.bool_(within)
        across = SPACING * (field[30, :, 20] < 0).sum()
        assert across == pytest.approx(SPACING * 10 + 4.0, abs=2 * SPACING)


def test_overlapping_surfaces_fill_their_union():
    points, triangles = sphere(5.0, 3)
    balls = [Surface(points, triangles), Surface(points + [3.0, 0, 0], triangles)]
    grid = Grid.around(balls[0].vertices, 6.0, SPACING)
    at = grid.points().reshape(*grid.shape, 3)
    exact = np.minimum(np.linalg.norm(at, axis=3), np.linalg.norm(at - [3.0, 0, 0], axis=3))
    clear = np.abs(exact - 5.0) > 0.2
    assert (occupied(balls, grid) == (exact < 5.0))[clear].all()


def test_flesh_lies_on_fingers_alone():
    cones = real_skin.pulp(phantom_hand.layout())
    assert {cone.start[0][:-1] for cone in cones} == {"proximal", "middle", "distal"}
