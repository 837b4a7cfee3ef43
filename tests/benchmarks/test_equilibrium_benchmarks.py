"""The benchmarks compare equal things: same material, same solutions, bodies as described."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse.linalg as spla
from benchmarks.fem import scaling, skfem_newton, thin_body, twist
from benchmarks.fem.__main__ import main

from handpipe.core import metrics
from handpipe.evaluation.benchmarks import benchmark_table, error_figures
from handpipe.fem.elements.materials import Material
from handpipe.fem.potentials.elastic import Elastic
from handpipe.mesh.surfaces.surface import Surface


def reference(beam: twist.Beam, poisson: float = twist.POISSON) -> skfem_newton.Reference:
    material = skfem_newton.NeoHookean(twist.YOUNG, poisson)
    return skfem_newton.Reference(
        beam.body.vertices, beam.body.tets, beam.clamped, material, solve_linear=spla.spsolve
    )


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.45, 0.49])
def test_reference_has_the_same_material(poisson: float) -> None:
    """Forces and stiffness of two derivations, at a shape with large strains."""
    beam = twist.Beam.build(2)
    x = beam.body.vertices + np.random.default_rng(0).normal(scale=0.1, size=beam.body.vertices.shape)
    ours = Elastic(beam.body.vertices, beam.body.tets, Material(twist.YOUNG, poisson))
    theirs = reference(beam, poisson)
    forces = theirs.forces((x - beam.body.vertices).ravel())[0]
    np.testing.assert_allclose(forces.reshape(-1, 3), ours.gradient(x), atol=1e-12)
    np.testing.assert_allclose(theirs.matrix(x).toarray(), ours.hessian(x).toarray(), atol=1e-11)


def test_twist_ends_in_the_references_state() -> None:
    beam = twist.Beam.build(3)
    own = twist.ours(beam)
    targets = [beam.ends(i / twist.STEPS) for i in range(1, twist.STEPS + 1)]
    found = reference(beam).follow(targets, twist.TOLERANCE)
    assert own.residual < twist.TOLERANCE
    assert found.residual < twist.TOLERANCE
    np.testing.assert_allclose(own.x, found.x, atol=1e-6)
    # Both have come all the way: the far end stands on its head.
    far = beam.body.where(0, 4.0)
    np.testing.assert_allclose(own.x[far, 1:], 1.0 - beam.body.vertices[far, 1:], atol=1e-12)


def test_twist_in_one_step_is_an_equilibrium() -> None:
    run = twist.at_once(twist.Beam.build(3))
    assert run.record.converged
    assert run.record.tangles == 0
    assert run.residual < twist.TOLERANCE


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Figures of a run with small sizes."""
    folder = tmp_path_factory.mktemp("quick")
    parts = ["twist", "scaling", "fat", "speed_against_error"]
    output = folder / "fem.json"
    main([*parts, "--quick", "--output", str(output), "--threads", "1"])
    return output


@pytest.fixture(scope="module")
def body(quick: Path) -> thin_body.ThinBody:
    return thin_body.thin_body(quick.with_name("thin-body-quick.h5"))


def test_thin_body_is_thin_and_its_inside_is_closed(body: thin_body.ThinBody) -> None:
    faces = body.mesh.boundary_faces()[0]
    inside = body.inner[faces].all(axis=1)
    inner = Surface(body.mesh.vertices, faces[inside]).compact().flipped()
    outer = Surface(body.mesh.vertices, faces[~inside]).compact()
    assert inner.volume() > 0
    assert not body.inner[faces[~inside]].any()
    np.testing.assert_allclose(outer.volume() - inner.volume(), body.mesh.volumes().sum(), rtol=1e-6)
    # Twice the volume over the area of both surfaces is the mean thickness.
    areas = outer.area() + inner.area()
    assert 1.5 < 2 * body.mesh.volumes().sum() / areas < 5.0


def test_flexion_moves_bones_rigidly_and_keeps_tets_positive(body: thin_body.ThinBody) -> None:
    x, moved = body.mesh.vertices, body.flexed(math.radians(60.0))
    proximal = x[:, 0] < thin_body.JOINT[0] - thin_body.BLEND
    distal = (x[:, 0] > thin_body.JOINT[0] + thin_body.BLEND) & (x[:, 1] < 40.0)
    np.testing.assert_allclose(moved[proximal], x[proximal], atol=1e-12)
    start, end = x[distal] - x[distal].mean(axis=0), moved[distal] - moved[distal].mean(axis=0)
    turn = np.linalg.lstsq(start, end, rcond=None)[0].T
    np.testing.assert_allclose(start @ turn.T, end, atol=1e-9)
    assert math.degrees(math.acos((np.trace(turn) - 1) / 2)) == pytest.approx(60.0)
    assert body.mesh.moved(moved).volumes().min() > 0


def test_exponent_of_a_power_law() -> None:
    unknowns = np.array([1e3, 4e3, 3e4])
    assert scaling.exponent(unknowns, 7e-9 * unknowns**1.7) == pytest.approx(1.7)


def test_quick_run_writes_figures_and_drawings(quick: Path) -> None:
    figures = json.loads(quick.read_text(encoding="utf-8"))
    assert all({"value", "unit"} <= set(found) for found in figures.values())
    if skfem_newton.missing():  # a figure without a value says why
        assert figures["twist_ratio_skfem_1k"]["value"] is None
        assert "pypardiso" in figures["twist_ratio_skfem_1k"]["reason"]
    else:
        assert figures["twist_difference_1k"]["value"] < 1e-6
    assert figures["paper_fat_converged"]["value"] == 1.0
    assert figures["paper_fat_residual"]["value"] < 1e-4
    assert figures["twist_one_step_converged_1k"]["value"] == 1.0
    assert figures["exponent_factor_flops"]["value"] > figures["exponent_factor_entries"]["value"]
    drawings = list(quick.parent.glob("error-by-*.svg"))
    assert len(drawings) == 2
    assert all(path.stat().st_size < 100_000 for path in drawings)


def test_report_shows_the_figures(quick: Path) -> None:
    figures = metrics.read(quick)
    table = benchmark_table(figures)
    assert table is not None
    assert [row[0] for row in table.rows][-1] == "its peak memory"
    assert set(error_figures(figures)) == {"mesh and material", "tolerance and solver"}
    assert benchmark_table({}) is None
    assert error_figures({}) == {}


def test_finer_meshes_and_tighter_tolerances_err_less(quick: Path) -> None:
    figures = json.loads(quick.read_text(encoding="utf-8"))
    curves = {name: found["value"] for name, found in figures.items() if name.endswith(", errors")}
    assert len(curves) == 7
    for errors in curves.values():
        assert errors[-1] < 0.5 * errors[0]
