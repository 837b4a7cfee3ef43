"""Shapes of another person: how far they vary, over what distance, and that nothing folds."""

import numpy as np
import pytest
import trimesh
from tests.fem.bodies import sphere

from handpipe.mesh.contact.crossing_triangles import crossings
from handpipe.mesh.surfaces.distance import Distance, surface_errors
from handpipe.mesh.surfaces.surface import Surface
from handpipe.synthetic.geometry.varied_shapes import FADING, LENGTH, Variation
from handpipe.tissues.muscles.fitting.template_placement import BoneWarp

BONE = Surface(*(np.asarray(a) for a in sphere(6.0, 3)))


def rod(length, radius):
    """A closed surface along x, 10 mm above the bone's centre."""
    ball = trimesh.creation.icosphere(subdivisions=4)
    return Surface(ball.vertices * [length / 2, radius, radius] + [0.0, 0.0, 10.0], ball.faces)


def test_displacements_are_gaussian_of_the_stated_width_and_reach():
    """Over many names, at two points a stated distance apart."""
    apart = np.array([[1.0, 2.0, 3.0], [1.0 + LENGTH, 2.0, 3.0], [1.0 + 4 * LENGTH, 2.0, 3.0]])
    moved = np.array([Variation(1, f"organ{i}", 0.8)(apart) - apart for i in range(2000)])
    assert np.abs(moved.mean(axis=0)).max() < 0.06
    assert moved.std(axis=0) == pytest.approx(0.8, rel=0.06)
    near, far = (np.einsum("ijc,ijc->jc", moved[:, :1], moved[:, k : k + 1])[0] / 2000 for k in (1, 2))
    assert near == pytest.approx(0.64 * np.exp(-0.5), abs=0.06)
    assert np.abs(far).max() < 0.06


def test_one_name_has_one_shape_and_others_others():
    points = np.random.default_rng(0).uniform(-30, 30, (50, 3))
    same = Variation(1, "adductor", 0.8)(points)
    assert (same == Variation(1, "adductor", 0.8)(points)).all()
    for other in (Variation(1, "opponens", 0.8), Variation(2, "adductor", 0.8)):
        assert np.abs(other(points) - same).max() > 0.5


def test_what_lies_on_a_bone_stays_and_what_is_far_varies_in_full():
    bones = Distance(BONE)
    with_bone, alone = Variation(1, "lumbrical1", 0.8, bones), Variation(1, "lumbrical1", 0.8)
    on = BONE.vertices
    assert with_bone(on) == pytest.approx(on, abs=1e-9)
    away = on * (6.0 + FADING + 0.5) / 6.0
    assert with_bone(away) == pytest.approx(alone(away), abs=1e-12)


def test_nothing_folds():
    """The derivative's determinant by differences, through the layer beside a bone, too."""
    bones, rng = Distance(BONE), np.random.default_rng(3)
    points = rng.normal(size=(4000, 3))
    points *= (rng.uniform(6.0, 16.0, 4000) / np.linalg.norm(points, axis=1))[:, None]
    for name in ("a", "b", "c", "d"):
        varied, step = Variation(7, name, 0.8, bones), 1e-4
        columns = [(varied(points + step * e) - varied(points - step * e)) / (2 * step) for e in np.eye(3)]
        assert np.linalg.det(np.stack(columns, axis=2)).min() > 0.15
        assert len(crossings(rod(40.0, 3.0).moved(varied(rod(40.0, 3.0).vertices)))) == 0


def test_no_map_by_the_bones_explains_the_shape():
    """Bones on both sides of a muscle, carried exactly, leave it off by what it varies."""
    bones = {"one": BONE, "other": BONE.moved(BONE.vertices + [0.0, 0.0, 20.0])}
    muscle, varied = rod(50.0, 3.0), Variation(4, "muscle", 0.8)
    template = muscle.moved(varied(muscle.vertices))
    placed = template.moved(BoneWarp(bones, bones)(template.vertices))
    assert surface_errors(placed, muscle).mean() > 0.3
