"""Rolling joints against motions that are known otherwise: a ball in a socket, a cylinder on a plane."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from handpipe.core import ConvergenceError
from handpipe.core.configuration.dataset import load_dataset
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


def ball_in_socket(centre) -> RollingJoint:
    """A ball of 6 mm that stays, in a socket of 6.6 mm that moves and presses from all sides."""
    ball = surface(trimesh.creation.icosphere(4, 6.0))
    socket = trimesh.creation.icosphere(3, 6.6).vertices
    contact = Contact(DistanceField.around(ball, ORIGIN, 8.0), socket, np.full(len(socket), 0.8), CARTILAGE)
    return RollingJoint(
        np.array(centre, float), np.eye(3), contact, bands([[-30.0, 0, 0]], [[0.0, 0, 0]]), (1,)
    )


@pytest.mark.parametrize("degrees", [20.0, -35.0])
def test_a_ball_in_a_socket_turns_about_its_centre_wherever_the_coordinates_are(degrees):
    joint = ball_in_socket((2.0, 0.0, 1.0))
    # On a ball all turns are free of charge: hold those that are not asked for.
    joint = replace(joint, driven=(0, 1, 2))
    start = joint.rest(np.zeros(6), np.zeros(3))
    end = joint.path(start, [np.radians([0.0, a, 0.0]) for a in (degrees / 2, degrees)])[-1]
    assert np.linalg.norm(joint.motion(end)(ORIGIN)) < 0.005  # facets of both balls
    assert np.linalg.norm(joint.motion(end)(joint.centre) - joint.centre) > 0.5


def wheel_on_plane(across: float, upright: float, force: float) -> RollingJoint:
    """An elliptic cylinder of 8 mm on a plane, pressed by a force in mN that acts in its axis."""
    box = trimesh.creation.box((40.0, 30.0, 6.0)).subdivide().subdivide().subdivide()
    box.apply_translation((0, 0, -3.0))
    plane = DistanceField.around(surface(box), ORIGIN, 9.0)
    angle, along = np.meshgrid(np.linspace(-np.pi, np.pi, 1600, endpoint=False), np.linspace(-3.5, 3.5, 8))
    x, z = across * np.sin(angle.ravel()), -upright * np.cos(angle.ravel())
    arc = np.hypot(across * np.cos(angle.ravel()), upright * np.sin(angle.ravel())) * 2 * np.pi / 1600
    lift = upright + CARTILAGE.thickness  # as built it touches without pressure
    points = np.column_stack([x, along.ravel(), z + lift])
    middle = [0.0, 0.0, lift]
    weight = bands([[0.0, 0, -1000.0]], [middle], tension=force)
    return RollingJoint(
        np.array(middle), np.eye(3), Contact(plane, points, arc, CARTILAGE), weight, (0, 1, 2)
    )


def test_a_cylinder_on_a_plane_sinks_by_the_law_of_the_foundation():
    """Force K / h 4/3 sqrt(2 R d) d L of an elastic foundation (Johnson 1985, section 4.3) at any angle."""
    joint, force = wheel_on_plane(5.0, 5.0, 20000.0), 20000.0
    stiffness = CARTILAGE.stiffness / CARTILAGE.thickness
    depth = (force / (stiffness * 4 / 3 * np.sqrt(2 * 5.0) * 8.0)) ** (2 / 3)
    for turn in (0.0, 0.6):
        at = joint.rest(np.zeros(6), np.array([0.0, turn, 0.0]))
        assert -at[5] == pytest.approx(depth, rel=0.03)
        assert abs(at[3]) < 1e-3


def test_an_elliptic_cylinder_rolls_along_its_support_function():
    """The axis is as high as the ellipse's tangent is far, whatever point of it touches."""
    joint = wheel_on_plane(5.0, 4.0, 500.0)
    at = joint.rest(np.zeros(6), np.zeros(3))
    for turn in (0.25, 0.5, 0.75):
        rolled = joint.path(at, [np.array([0.0, turn, 0.0])])[-1]
        height = np.hypot(5.0 * np.sin(turn), 4.0 * np.cos(turn))
        assert rolled[5] - at[5] == pytest.approx(height - 4.0, abs=0.01)


def test_gradients_by_differences():
    joint = ball_in_socket((1.0, -2.0, 0.5))
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
