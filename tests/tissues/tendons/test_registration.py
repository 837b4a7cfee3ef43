"""Registration against manufactured courses."""

from __future__ import annotations

import numpy as np
import pytest

from handpipe.core.arrays import Array
from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface
from handpipe.tissues.tendons.fitting.motion import relative_to, screw, steps_towards
from handpipe.tissues.tendons.fitting.registration import (
    RegistrationSettings,
    centreline_errors,
    fit_surface,
    follow_bones,
    register,
)
from handpipe.tissues.tendons.fitting.surface_fit import TendonTarget
from handpipe.tissues.tendons.rods.rod import closest_on_rod, lay, length_change, point_at
from handpipe.tissues.tendons.rods.tube import round_surface

from .finger import RADIUS, course, pose, rest_tendon, true_rod

ANGLES = (1.2, 0.8)  # rad


def centres_of(curve: Array, noise: float, seed: int = 0):
    """A stand-in for the image: the true centre nearest to a point, with noise and some unseen sections."""
    random = np.random.default_rng(seed)

    def find(points: Array, tangents: Array) -> tuple[Array, Array]:
        segment, t, distance = closest_on_rod(points, curve)
        confidence = np.where((random.random(len(points)) > 0.2) & (distance < 3.0), 0.9, 0.0)
        return point_at(curve, segment, t) + noise * random.standard_normal(points.shape), confidence

    return find


def noisy_tube(curve: Array, noise: float) -> Surface:
    surface = round_surface(curve[::5], RADIUS)
    return surface.moved(
        surface.vertices + noise * np.random.default_rng(2).standard_normal(surface.vertices.shape)
    )


def test_recovers_a_course_from_a_noisy_tube() -> None:
    rest, truth = rest_tendon(), course(*ANGLES)
    target = TendonTarget(Distance(noisy_tube(truth, 0.15)))
    found = register(rest, pose(*ANGLES), centres_of(truth, 0.15), lambda x: target)
    errors = np.concatenate(centreline_errors(found.x, truth))
    assert errors.mean() < 0.1
    assert length_change(found.x, rest.length) < 1e-10
    np.testing.assert_allclose(found.x[0], truth[0], atol=1e-9)
    assert np.linalg.norm(found.x[-1] - true_rod(rest, *ANGLES)[-1]) < 0.5


def test_each_stage_brings_it_nearer() -> None:
    rest, truth = rest_tendon(), course(*ANGLES)
    target = TendonTarget(Distance(noisy_tube(truth, 0.02)))
    found = register(rest, pose(*ANGLES), centres_of(truth, 0.1), lambda x: target)
    rough, centred, final = (
        np.concatenate(centreline_errors(x, truth)).mean() for x in (found.rough, found.centred, found.x)
    )
    assert rough < 1.0 and final < centred < rough


def test_surface_alone_recovers_a_shifted_rod() -> None:
    """Without centres, and with the dark bone side left out: Eq. 18 alone leads back."""
    rest, truth = rest_tendon(), course(0.5, 0.3)
    bones = pose(0.5, 0.3)
    rod = true_rod(rest, 0.5, 0.3)
    shifted = rod + [0.0, 0.5, 0.3] * (1 - np.exp(-np.arange(len(rod)) / 5.0))[:, None]
    start = lay(shifted, rest.length, len(rod) - 1, np.array([-1.0, 0, 0]))
    centre_depth = Distance(round_surface(truth[::5], 0.3))
    target = TendonTarget(Distance(noisy_tube(truth, 0.05)), lambda q: centre_depth.signed(q)[0], margin=0.2)
    x, _ = fit_surface(rest, bones, start, target, RegistrationSettings())
    assert np.concatenate(centreline_errors(start, truth)).mean() > 0.3
    assert np.concatenate(centreline_errors(x, truth)).mean() < 0.05


@pytest.mark.parametrize("angles", [(1.9, 1.2), (-0.6, -0.3), (0.0, 0.0)])
def test_stage_one_follows_large_motions_of_a_moved_hand(angles: tuple[float, float]) -> None:
    """The base bone of an image is anywhere: the result moves with it."""
    rest = rest_tendon()
    moved = RigidTransform.about(
        np.array([5.0, 3, 1]), np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    )
    if np.linalg.det(moved.rotation) < 0:
        moved = RigidTransform(-moved.rotation, moved.translation)
    bones = pose(*angles)
    still = follow_bones(rest, bones, RegistrationSettings())
    there = follow_bones(rest, {n: moved @ t for n, t in bones.items()}, RegistrationSettings())
    np.testing.assert_allclose(there, moved(still), atol=1e-6)
    # no hooks stand on the arcs yet, so that the rod cuts them
    assert np.concatenate(centreline_errors(still, true_rod(rest, *angles))).mean() < 2.5


def test_screw_shares_of_a_hinge_are_smaller_turns() -> None:
    whole = pose(1.4, 0.0)["middle"]
    half = pose(0.7, 0.0)["middle"]
    found = screw(whole, 0.5)
    np.testing.assert_allclose(found.rotation, half.rotation, atol=1e-12)
    np.testing.assert_allclose(found.translation, half.translation, atol=1e-9)


def test_steps_keep_joints_together() -> None:
    steps = steps_towards(pose(1.4, 0.9), ("distal", "middle", "base"), 0.3)
    assert len(steps) == 5
    joint = np.array([[60.0, 0, 0]])
    for step in steps:
        np.testing.assert_allclose(step["distal"](joint), step["middle"](joint), atol=1e-9)
    np.testing.assert_allclose(steps[-1]["distal"].rotation, pose(1.4, 0.9)["distal"].rotation, atol=1e-12)
    assert relative_to(pose(1.4, 0.9), "middle")["middle"].angle_to(RigidTransform.identity()) < 1e-7
