"""Overlapping ellipsoids come apart, keep their volume and do not move where nothing touches."""

import numpy as np
import pytest
import trimesh

from handpipe.mesh.distance import Distance, sample_points
from handpipe.mesh.surface import Surface
from handpipe.muscles.separation import separate, volume_gradient


def ellipsoid(radii, centre, subdivisions: int = 4) -> Surface:
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Surface(sphere.vertices * radii + centre, sphere.faces)


def depth(a: Surface, b: Surface) -> float:
    return max(0.0, -Distance(b).signed(sample_points(a, 20000))[0].min())


def test_two_muscles_come_apart_and_keep_their_volume():
    muscles = {"a": ellipsoid([25, 5, 4], [0, 0, 0]), "b": ellipsoid([22, 5, 4], [4, 1, 7.0])}
    result = separate(muscles, {})
    assert depth(muscles["a"], muscles["b"]) > 0.5
    for name, other in (("a", "b"), ("b", "a")):
        surface, start = result.surfaces[name], muscles[name]
        assert depth(surface, result.surfaces[other]) < 0.05
        assert surface.volume() == pytest.approx(start.volume(), rel=0.01)
        moved = np.linalg.norm(surface.vertices - start.vertices, axis=1)
        far = Distance(muscles[other]).closest(start.vertices)[0] > 6
        assert far.sum() > 50 and moved[far].max() < 0.08  # of the volume given back
        assert moved.max() > 0.2  # each of the two gave way


def test_smooth_where_it_was_pushed():
    muscles = {"a": ellipsoid([25, 5, 4], [0, 0, 0]), "b": ellipsoid([22, 5, 4], [4, 1, 7.0])}
    result = separate(muscles, {})
    for name, start in muscles.items():
        ends = start.triangles[:, [0, 1]]
        shift = result.surfaces[name].vertices - start.vertices
        slope = np.linalg.norm(shift[ends[:, 0]] - shift[ends[:, 1]], axis=1)
        slope /= np.linalg.norm(start.vertices[ends[:, 0]] - start.vertices[ends[:, 1]], axis=1)
        assert slope.max() < 0.3


def test_a_bone_stays_and_the_muscle_gives_way():
    bone = ellipsoid([30, 5, 5], [0, 0, -8.2])
    result = separate({"a": ellipsoid([25, 5, 4], [0, 0, 0])}, {"bone": bone})
    assert result.penetration_before > 0.5
    assert depth(result.surfaces["a"], bone) < 0.05
    assert depth(bone, result.surfaces["a"]) < 0.05


def test_apart_is_left_alone():
    muscles = {"a": ellipsoid([25, 5, 4], [0, 0, 0]), "b": ellipsoid([22, 5, 4], [4, 1, 9.0])}
    result = separate(muscles, {})
    for name, start in muscles.items():
        assert np.array_equal(result.surfaces[name].vertices, start.vertices)


def test_volume_gradient_agrees_with_differences():
    surface = ellipsoid([3, 2, 1], [1, 2, 3], subdivisions=1)
    gradient = volume_gradient(surface)
    for vertex, axis in ((0, 0), (7, 2)):
        step = np.zeros_like(surface.vertices)
        step[vertex, axis] = 1e-5
        change = (
            surface.moved(surface.vertices + step).volume() - surface.moved(surface.vertices - step).volume()
        )
        assert gradient[vertex, axis] == pytest.approx(change / 2e-5, rel=1e-6)


@pytest.mark.parametrize("seed", [2, 22, 25])
def test_thin_coarse_muscles_across_one_another_on_a_bone(seed):
    """A point in a dimple of few triangles has a closest one that swings; steps must not swing with it."""
    rng = np.random.default_rng(seed)
    centre = [rng.uniform(6, 9), rng.uniform(-1, 1), rng.uniform(-0.9, 0.9)]
    across = trimesh.transformations.rotation_matrix(rng.uniform(0, 2), [0, 0, 1])[:3, :3]
    other = ellipsoid([8, 1.0, 1.5], [0, 0, 0], 2)
    muscles = {
        "a": ellipsoid([10, 1.2, 1.0], [0, 0, 0], 2),
        "b": other.moved(other.vertices @ across.T + centre),
    }
    bone = ellipsoid([20, 4, 4], [0, 0, -5.0], 3)
    found = separate(muscles, {"bone": bone})
    assert found.penetration_before > 0.4
    a, b = found.surfaces["a"], found.surfaces["b"]
    for one, two in ((a, b), (b, a), (a, bone), (b, bone)):
        vertices = Distance(two).signed(one.vertices)[0]
        assert vertices.min() > -0.05
    for name, start in muscles.items():
        assert found.surfaces[name].volume() == pytest.approx(start.volume(), rel=0.01)
