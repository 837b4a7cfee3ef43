"""What holds a tissue, and its equilibria."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handpipe.core.errors import ConvergenceError, InputError
from handpipe.core.layers import Region
from handpipe.core.rigid import RigidTransform
from handpipe.fem.contact.one_sided import penalty
from handpipe.fem.solver.settling import Limits
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface
from handpipe.tissues.fat.resting.from_starts import settled_from
from handpipe.tissues.fat.resting.load_case import LoadCase
from handpipe.tissues.fat.tissue import Tissue

from .limb import CORE, LENGTH, at_rest, below, capsule, limb

KINDS = [Region.fixed, Region.sliding, Region.contact]


@pytest.mark.parametrize("kind", KINDS)
def test_an_unloaded_tissue_stays_at_rest(kind):
    tissue = limb(kind)
    x = settled_from(LoadCase.of(tissue, below(kind=kind), at_rest()), tissue.mesh.vertices).x
    np.testing.assert_allclose(x, tissue.mesh.vertices, atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_a_common_rigid_motion_moves_the_tissue_rigidly(kind):
    tissue = limb(kind)
    motion = RigidTransform(Rotation.from_rotvec([0.5, -0.8, 0.3]).as_matrix(), np.array([3.0, -20.0, 7.0]))
    start = tissue.pose({"core": motion})
    posed = motion(capsule(CORE, 1.0).vertices)
    x = settled_from(LoadCase.of(tissue, below(posed, kind), {"tip": motion}), start).x
    np.testing.assert_allclose(x, motion(tissue.mesh.vertices), atol=1e-6)


def test_a_disturbed_start_comes_back_to_rest():
    tissue = limb(Region.fixed)
    noise = 0.1 * np.random.default_rng(0).normal(size=tissue.mesh.vertices.shape)
    x = settled_from(LoadCase.of(tissue, below(), at_rest()), tissue.mesh.vertices + noise).x
    np.testing.assert_allclose(x, tissue.mesh.vertices, atol=1e-3)


def test_skin_and_fat_are_stretched_side_by_side(tmp_path):
    """The energy of one stretch is the mean of skin's and fat's, by their volumes; a file keeps it."""
    plain, moduli = limb(), {"fat": 1.0, "skin": 20.0}
    share = np.random.default_rng(0).uniform(size=len(plain.mesh.tets))
    tissue = replace(plain, skin_share=share)
    x = plain.mesh.vertices * [1.2, 0.95, 1.0]
    alone = {
        name: replace(plain, settings=replace(plain.settings, young=young)).elastic.value(x)
        for name, young in moduli.items()
    }
    volumes = plain.mesh.volumes() * plain.occupancy
    mean = volumes @ share / volumes.sum()
    expected = mean * alone["skin"] + (1 - mean) * alone["fat"]
    assert tissue.elastic.value(x) == pytest.approx(expected)
    tissue.save(tmp_path / "fat.h5", [])
    assert Tissue.load(tmp_path / "fat.h5").elastic.value(x) == pytest.approx(expected)
    plain.save(tmp_path / "plain.h5", [])
    assert Tissue.load(tmp_path / "plain.h5").skin_share is None


def test_fixed_points_follow_the_bone():
    tissue = limb(Region.fixed)
    shift = np.array([0.0, 1.0, 0.0])
    posed = capsule(CORE, 1.0).vertices + shift
    x = settled_from(LoadCase.of(tissue, below(posed), at_rest()), tissue.mesh.vertices).x
    error = np.linalg.norm(tissue.inner_matrix @ x - tissue.inner.rest - shift, axis=1)
    assert error.max() < 0.15 and np.sqrt((error**2).mean()) < 0.03
    skin = tissue.skin_matrix @ x - tissue.skin.vertices
    distal = tissue.skin.vertices[:, 0] > 0
    assert skin[distal, 1].min() > 0.3  # the skin goes along, softly
    assert np.linalg.norm(skin[tissue.rigid["tip"].vertices], axis=1).max() < 0.1


def test_contact_pushes_the_tissue_out_and_never_pulls_it():
    tissue = limb(Region.contact)
    core = capsule(CORE, 1.0)
    for factor in (1.2, 0.7):
        posed = core.vertices * [1.0, factor, factor]
        case = LoadCase.of(tissue, below(posed, Region.contact), at_rest())
        settled = settled_from(case, tissue.mesh.vertices)
        x = settled.x
        heights = Distance(core.moved(posed)).signed(tissue.inner_matrix @ x)[0]
        # Planes with the normals of this coarse core's facets end in a cycle of 0.1 mm.
        assert settled.rests and heights.min() > -0.2 and heights.mean() > -0.07
        if factor < 1:
            np.testing.assert_allclose(x, tissue.mesh.vertices, atol=1e-3)


def test_contact_and_tissue_are_springs_in_series():
    """A bone swells: contact gives way by a part of it, the tissue by the rest, at one pressure.

    The penalty's force is its stiffness times the depth beyond half its onset of 0.05 mm; from 0.2 mm on a
    second one is eight times as stiff.
    """
    core, moduli = capsule(CORE, 1.0), []
    for swell, young in ((0.3, 5.0), (0.6, 50.0), (0.9, 50.0)):
        swollen = below(core.vertices + swell * core.vertex_normals(), Region.contact)
        tissue = limb(Region.contact)
        tissue = replace(tissue, settings=replace(tissue.settings, young=young))
        x = settled_from(LoadCase.of(tissue, swollen, at_rest()), tissue.mesh.vertices).x
        surface = core.moved(swollen["bones"]["core"].vertices)
        depths = -Distance(surface).signed(tissue.inner_matrix @ x)[0]
        pressure = 50.0 * (penalty(depths, 0.05)[1] + 8 * penalty(depths - 0.2, 0.05)[1]).mean()
        moduli.append(pressure / young / (swell - depths.mean()))
    np.testing.assert_allclose(moduli, moduli[0], rtol=0.2)


def test_sliding_tissue_stays_on_the_bone_but_does_not_turn_with_it():
    turn = RigidTransform(Rotation.from_rotvec([1.0, 0, 0]).as_matrix(), np.zeros(3))
    core = capsule(CORE, 1.0)
    posed = turn(core.vertices)
    middle = np.abs(core.vertices[:, 0]) < LENGTH / 3
    turned = {}
    for kind in (Region.sliding, Region.fixed):
        tissue = limb(kind)
        x = settled_from(LoadCase.of(tissue, below(posed, kind), at_rest()), tissue.mesh.vertices).x
        points = tissue.inner_matrix @ x
        assert np.abs(Distance(core.moved(posed)).signed(points)[0]).max() < 0.1
        moved = np.linalg.norm(points - tissue.inner.rest, axis=1)
        turned[kind] = moved[middle[tissue.inner.vertex]].mean()
    assert turned[Region.fixed] > 0.8 * 2 * CORE * np.sin(0.5)
    assert turned[Region.sliding] < 0.05 * turned[Region.fixed]


def test_a_skin_that_does_not_come_to_rest_is_no_result():
    strict = Limits(renewals=1, settled=1e-3, gross=0.1)
    posed = capsule(CORE, 1.0).vertices + [0.0, 1.0, 0.0]
    tissue = limb(Region.fixed)
    with pytest.raises(ConvergenceError, match="soft tissue did not converge: it moves by"):
        settled_from(LoadCase.of(tissue, below(posed), at_rest()), tissue.mesh.vertices, strict)


def test_plastic_growth_swells_the_tissue():
    tissue = limb(Region.fixed)
    grown = np.tile([1.05, 0, 0, 1.05, 0, 1.05], (len(tissue.mesh.tets), 1))
    x = settled_from(LoadCase.of(tissue, below(), at_rest(), grown), tissue.mesh.vertices).x
    outside = tissue.skin.moved(tissue.skin_matrix @ x).volume() - tissue.skin.volume()
    tissue_volume = tissue.occupancy @ tissue.mesh.volumes()
    assert outside == pytest.approx((1.05**3 - 1) * tissue_volume, rel=0.15)


def test_a_tissue_survives_its_artifact(tmp_path):
    tissue = limb(Region.contact)
    tissue.save(tmp_path / "tissue.h5", [])
    again = Tissue.load(tmp_path / "tissue.h5")
    for name in ("occupancy", "weights"):
        np.testing.assert_array_equal(getattr(again, name), getattr(tissue, name))
    for name, value in vars(tissue.inner).items():
        np.testing.assert_array_equal(getattr(again.inner, name), value)
    np.testing.assert_array_equal(again.mesh.tets, tissue.mesh.tets)
    np.testing.assert_array_equal(again.rigid["tip"].vertices, tissue.rigid["tip"].vertices)
    assert (again.bones, again.settings) == (tissue.bones, tissue.settings)
    posed = capsule(CORE, 1.0).vertices * [1.0, 1.1, 1.1]
    first, second = (
        settled_from(LoadCase.of(body, below(posed, Region.contact), at_rest()), body.mesh.vertices).x
        for body in (tissue, again)
    )
    np.testing.assert_array_equal(first, second)


def test_an_artifact_of_another_kind_is_refused(tmp_path):
    from handpipe.core import artifacts

    artifacts.write(tmp_path / "other.h5", {"x": 1.0}, kind="other")
    with pytest.raises(InputError, match="tissue"):
        Tissue.load(tmp_path / "other.h5")


def test_surfaces_of_inner_points_are_the_posed_bodies():
    posed = capsule(CORE, 1.0).vertices + 1.0
    [surface] = limb().inner.surfaces(below(posed))
    assert isinstance(surface, Surface)
    np.testing.assert_array_equal(surface.vertices, posed)
    np.testing.assert_allclose(limb().inner.posed(below(posed)), limb().inner.rest + 1.0)


def test_a_point_outside_its_tet_has_its_own_side_at_rest() -> None:
    """Such a point has negative weights; a vertex with large tets must not turn its side over."""
    tissue = limb(Region.contact)
    away = replace(tissue.inner, rest=tissue.inner.rest + 16.0 * tissue.inner.normal)
    outside = replace(tissue, inner=away)
    assert outside.inner_matrix.min() < -1.0
    ids = np.arange(len(away.rest))
    np.testing.assert_allclose(outside.sides(outside.mesh.vertices, ids), away.normal, atol=1e-9)
