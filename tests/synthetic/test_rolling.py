"""Rolling joints against motions that are known otherwise: a ball in a socket, a cylinder on a plane."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from handpipe.core import ConvergenceError
from handpipe.core.configuration.config import load_dataset
from handpipe.synthetic import generators
from handpipe.synthetic.phantom.phantom_hand_joints import POSES
from handpipe.synthetic.rolling import rolling_hand
from handpipe.synthetic.rolling.articular import Cartilage, Contact, DistanceField
from handpipe.synthetic.rolling.bands import TOE, Bands
from handpipe.synthetic.rolling.equilibrium import LEVER, RollingJoint, minimum

CONFIG = Path(__file__).parents[2] / "config/datasets"
CARTILAGE = Cartilage(0.9, 4000.0, 0.42)
ORIGIN = np.zeros(3)


def surface(mesh: trimesh.Trimesh):
    return np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)


def bands(origins, insertions, stiffness=0.0, tension=0.0, slack=1.0) -> Bands:
    n = len(origins)
    full = [np.full(n, float(v)) for v in (slack, stiffness, tension)]
    return Bands(np.array(origins, float), np.array(insertions, float), *full)


def ball_on_socket(centre) -> RollingJoint:
    """A ball of 6 mm that stays, a cap of points 6.6 mm about the same centre that moves, pulled towards it."""
    ball = surface(trimesh.creation.icosphere(4, 6.0))
    cap = trimesh.creation.icosphere(3, 6.6).vertices
    cap = cap[cap[:, 0] > 3.0]
    # The pull acts in the ball's own centre and does not depend on the turn.
    pull = bands([[-30.0, 0, 0]], [[0.0, 0, 0]], tension=2000.0)
    contact = Contact(DistanceField.around(ball, ORIGIN, 8.0), cap, np.full(len(cap), 0.8), CARTILAGE)
    return RollingJoint(np.array(centre, float), np.eye(3), contact, pull, (1,))


@pytest.mark.parametrize("degrees", [20.0, -35.0])
def test_a_ball_in_a_socket_turns_about_its_centre_wherever_the_coordinates_are(degrees):
    joint = ball_on_socket((2.0, 0.0, 1.0))
    # On a ball all turns are free of charge: hold those that are not asked for.
    joint = replace(joint, driven=(0, 1, 2))
    start = joint.rest(np.zeros(6), np.zeros(3))
    end = joint.path(start, [np.array([0, a, 0]) for a in np.radians(np.linspace(0, degrees, 5))])[-1]
    # Only the pressed layer lets the cap's centre come nearer along the pull.
    assert np.linalg.norm(joint.motion(end)(ORIGIN)) < 0.03
    assert np.linalg.norm(joint.motion(end)(joint.centre) - joint.centre) > 0.5


def test_a_cylinder_rolls_on_a_plane():
    """Without friction it would slide: a ribbon that is wound off holds it, and its path is that of a wheel."""
    radius, turn = 5.0, np.radians(30.0)
    box = trimesh.creation.box((40.0, 30.0, 10.0))
    box = box.subdivide().subdivide().subdivide()
    box.apply_translation((0, 0, -5.0 - 0.6))
    plane = DistanceField.around(surface(box), ORIGIN, 12.0)
    angle, along = np.meshgrid(np.linspace(-np.pi, np.pi, 240, endpoint=False), np.linspace(-4, 4, 9))
    points = np.column_stack(
        [radius * np.sin(angle.ravel()), along.ravel(), radius * (1 - np.cos(angle.ravel()))]
    )
    contact = Contact(plane, points, np.full(len(points), 0.1), CARTILAGE)
    # Ribbons over the wheel's contact line to both sides of it, as cruciate ligaments.
    side = np.array([[0.0, y, 0.0] for y in (-3.0, 3.0)])
    far = np.array([[20.0, 0, 0], [-20.0, 0, 0]])
    crossed = bands((side[:, None] + far).reshape(-1, 3), np.repeat(side, 2, axis=0), 5e5, 0.0, 19.5)
    weight = bands([[0.0, 0, -1000.0]], [[0.0, 0, radius]], 0.0, 5000.0)
    both = Bands(*(np.concatenate([a, b]) for a, b in zip(vars(crossed).values(), vars(weight).values(), strict=True)))
    joint = RollingJoint(np.array([0.0, 0, radius]), np.eye(3), contact, both, (1,))
    rest = joint.rest(np.zeros(6), np.zeros(1))
    rolled = joint.path(rest, [np.array([a]) for a in np.linspace(0, turn, 7)])[-1]
    # The marked point is held at the line of contact: the axis comes to -radius * sin(turn).
    held = joint.motion(rolled)(np.zeros(3))
    assert np.abs(held[0]) < 0.1
    assert rolled[3] - rest[3] == pytest.approx(radius * np.sin(turn), abs=0.1)
    assert rolled[5] == pytest.approx(rest[5], abs=0.1)  # the axis stays at one height
    assert np.abs(rolled[[0, 2, 4]] - rest[[0, 2, 4]]).max() < 0.01


def test_gradients_by_differences():
    joint = ball_on_socket((1.0, -2.0, 0.5))
    sprung = bands([[-1, 6, 1], [-1, -6, 1], [0, 5, -4]], [[8, 5, 2], [8, -6, 1], [7, 4, -5]], 3e5, 0.0, 8.8)
    joint = replace(joint, bands=sprung)
    rng = np.random.default_rng(1)
    for size in (0.02, 0.1, 0.3):
        at = size * rng.normal(size=6)
        steps = 1e-6 * np.eye(6)
        slopes = [(joint.energy(at + d)[0] - joint.energy(at - d)[0]) / 2e-6 for d in steps]
        found = joint.energy(at)[1]
        np.testing.assert_allclose(found, slopes, atol=1e-6 * np.abs(found).max())


def test_a_ligament_is_slack_then_soft_then_straight():
    band = bands([[0.0, 0, 0]], [[10.0, 0, 0]], stiffness=1e5, slack=10.0)

    def force(strain: float) -> float:
        return float(band.energy(np.array([[10 * (1 + strain), 0, 0]]))[1][0, 0])

    assert force(-0.1) == 0
    assert force(TOE) == pytest.approx(1e5 * TOE / 4)
    assert force(2 * TOE) == pytest.approx(1e5 * TOE)
    assert force(3 * TOE) - force(2 * TOE) == pytest.approx(1e5 * TOE)


def test_the_field_is_the_distance_to_a_ball():
    field = DistanceField.around(surface(trimesh.creation.icosphere(5, 6.0)), ORIGIN, 9.0)
    points = np.random.default_rng(0).normal(size=(200, 3))
    points *= np.linspace(5.0, 7.5, 200)[:, None] / np.linalg.norm(points, axis=1)[:, None]
    distance, normal = field(points)
    np.testing.assert_allclose(distance, np.linalg.norm(points, axis=1) - 6.0, atol=0.02)
    outwards = points / np.linalg.norm(points, axis=1)[:, None]
    assert (np.einsum("ni,ni->n", normal, outwards) > 0.99).all()


def test_what_has_no_least_energy_is_refused():
    with pytest.raises(ConvergenceError, match="rolling joint"):
        minimum(lambda x: (float(-LEVER * x[0]), np.array([-LEVER])), np.zeros(1))


def test_neighbours_are_coupled():
    for pose, angles in rolling_hand.poses().items():
        assert set(angles) == set(POSES[pose])
        for ray in (2, 3, 4, 5):
            assert angles[f"DIP{ray}_flexion"] == pytest.approx(2 / 3 * angles[f"PIP{ray}_flexion"], abs=0.06)
            if angles[f"MP{ray}_flexion"] > 60:
                assert abs(angles[f"MP{ray}_abduction"]) < 6
    spread = rolling_hand.poses()["spread"]
    assert spread["MP5_abduction"] == POSES["spread"]["MP5_abduction"]  # hardly bent: all of it


def test_the_dataset_has_the_bones_and_poses_of_the_phantom_hand():
    rolling, plain = (load_dataset(CONFIG / f"phantom-hand{name}.yaml") for name in ("-rolling", ""))
    assert rolling.bones == plain.bones and rolling.joints == plain.joints
    assert {p: v.role for p, v in rolling.poses.items()} == {p: v.role for p, v in plain.poses.items()}
    assert generators.generator_of(rolling) is rolling_hand
    assert set(rolling.poses) == set(rolling_hand.poses())
