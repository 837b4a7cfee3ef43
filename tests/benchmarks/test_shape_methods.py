"""Further methods and bodies that shapes are compared on: energies have known values, bodies known shapes."""

import numpy as np
import pytest
import trimesh
from benchmarks.shapes import density, other_methods, standard
from benchmarks.shapes.bending import Bending
from benchmarks.shapes.comparison_bodies import BODIES, Body, rod
from benchmarks.shapes.other_methods import METHODS
from benchmarks.shapes.standard_bodies import ARM, LONG, STANDARD, THICK, arms, cylinder
from benchmarks.shapes.transfer import SmoothGradients
from scipy.spatial.transform import Rotation

from handpipe.mesh.tets import TetMesh
from handpipe.shapes.observations.marks import Pairs
from handpipe.shapes.organs import Observed, fit_organ


def ball() -> tuple[np.ndarray, np.ndarray]:
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=10.0)
    return np.asarray(sphere.vertices), np.asarray(sphere.faces).astype(np.int64)


@pytest.mark.parametrize("scale", [0.8, 1.3])
def test_bending_of_a_ball_that_grows(scale: float) -> None:
    """The area's integral of (2 (s - 1) / r)^2 is 16 pi (s - 1)^2, whatever the radius."""
    x, faces = ball()
    turned = scale * x @ Rotation.from_euler("xyz", [20, 70, -40], degrees=True).as_matrix().T
    energy = Bending(x, faces, np.array([0])).energy(turned + 5.0)
    assert energy == pytest.approx(16 * np.pi * (scale - 1) ** 2, rel=0.02)


def test_nothing_near_the_least_bending_bends_less() -> None:
    x, faces = ball()
    points = np.array([0, 1, 2, 3, 4, 5])
    targets = x[points] + np.random.default_rng(0).normal(size=(6, 3))
    surface = Bending(x, faces, points)
    found = surface.least(x, targets)
    assert np.array_equal(found[points], targets)
    least = surface.energy(found)
    rng = np.random.default_rng(1)
    for _ in range(10):
        other = found + 0.02 * rng.normal(size=found.shape)
        other[points] = targets
        assert surface.energy(other) > least


def squeezed(places: np.ndarray) -> np.ndarray:
    return places * [40.0, 6.0, 6.0]


def test_deformation_transfer_costs_nothing_for_affine_maps() -> None:
    places, tets = rod(2, 8)
    mesh = TetMesh(squeezed(places), tets)
    potential = SmoothGradients(mesh, 6.0)
    affine = mesh.vertices @ np.array([[1.5, 0.2, 0.0], [0.0, 0.7, 0.1], [0.3, 0.0, 1.1]]) + 4.0
    bent = mesh.vertices + 0.01 * mesh.vertices[:, :1] ** 2 * [0.0, 0.0, 1.0]
    assert potential.value(affine) < 1e-9 * potential.value(bent)
    direction = np.random.default_rng(0).normal(size=bent.shape)
    step = 1e-3
    slope = (potential.value(bent + step * direction) - potential.value(bent - step * direction)) / (2 * step)
    assert slope == pytest.approx(float((potential.gradient(bent) * direction).sum()), rel=1e-6)
    curved = (potential.gradient(bent + step * direction) - potential.gradient(bent)).ravel() / step
    assert curved == pytest.approx(potential.hessian(bent) @ direction.ravel(), rel=1e-4, abs=1e-3)


def test_deformation_transfer_is_the_same_on_a_finer_mesh() -> None:
    found = []
    for fine in (1, 2):
        places, tets = rod(2 * fine, 8 * fine)
        mesh = TetMesh(squeezed(places), tets)
        bent = mesh.vertices + 0.01 * mesh.vertices[:, :1] ** 2 * [0.0, 0.0, 1.0]
        found.append(SmoothGradients(mesh, 6.0).value(bent))
    assert found[1] == pytest.approx(found[0], rel=0.15)


@pytest.mark.parametrize("method", ["bounded_biharmonic", "bending_incremental", "elastic_incremental"])
def test_methods_follow_a_translation(method: str) -> None:
    body = BODIES["muscle"](0)
    moved = Body(body.mesh, body.mesh.vertices + [3.0, -1.0, 2.0], body.attached, body.marked, body.side)
    outer = body.mesh.boundary_vertices()
    assert np.abs(METHODS[method](moved) - moved.truth)[outer].max() < 0.01


def test_with_incremental_plasticity_the_path_is_part_of_the_result(monkeypatch: pytest.MonkeyPatch) -> None:
    """The hysteresis of Wang 2021 §5.9.8: other increments, other shape; the elastic shape stays."""
    body = BODIES["beam"](0)
    found: dict[str, list[np.ndarray]] = {"elastic": [], "elastic_incremental": []}
    for steps in (4, 12):
        monkeypatch.setattr(other_methods, "STEPS", steps)
        monkeypatch.setattr(other_methods, "INCREMENTS", steps)
        for method, shapes in found.items():
            shapes.append(METHODS[method](body))
    moved = {method: float(np.abs(one - other).max()) for method, (one, other) in found.items()}
    assert moved["elastic"] < 0.01
    assert moved["elastic_incremental"] > 0.1


@pytest.mark.parametrize("name", STANDARD)
def test_standard_bodies(name: str) -> None:
    body = STANDARD[name]()
    assert body.mesh.volumes().min() > 0
    assert body.wanted.volumes().min() > 0
    assert np.allclose(body.truth[body.attached], body.mesh.vertices[body.attached])
    assert not set(body.attached) & set(body.marked)
    before, after = body.mesh.vertices[body.marked], body.truth[body.marked]
    distances = [np.linalg.norm(x - x[0], axis=1) for x in (before, after)]
    assert np.allclose(*distances)  # the moved end is rigid
    assert standard.measures(name, body, body.truth)["volume"] == pytest.approx(0.0, abs=0.5)


@pytest.mark.parametrize(("name", "angle"), [("cylinder", 120.0), ("twist", 135.0), ("cactus", 70.0)])
def test_the_moved_end_turns_by_the_angle(name: str, angle: float) -> None:
    body = STANDARD[name]()
    before, after = body.mesh.vertices[body.marked], body.truth[body.marked]
    turn = Rotation.align_vectors(after - after.mean(axis=0), before - before.mean(axis=0))[0]
    assert np.degrees(turn.magnitude()) == pytest.approx(angle)


def test_the_middle_line_of_the_bent_cylinder_keeps_its_length() -> None:
    body = STANDARD["cylinder"]()
    middle = (np.abs(body.mesh.vertices[:, 1:]) < 1e-9).all(axis=1)
    line = body.truth[middle][np.argsort(body.mesh.vertices[middle, 0])]
    assert np.linalg.norm(np.diff(line, axis=0), axis=1).sum() == pytest.approx(LONG, rel=0.01)


def test_only_the_wrong_attachment_of_a_bent_cylinder_is_left_out() -> None:
    """Of two ends that are attached all over, the fit that checks them begins far away."""
    body = cylinder(2, 12)
    points = np.concatenate([body.attached, body.marked])
    targets = body.truth[points].copy()
    targets[5] += [0.0, -12.0, 12.0]
    fit = fit_organ(body.mesh, Observed(attachments=Pairs(body.mesh.vertices[points], targets)))
    assert np.flatnonzero(fit.doubtful).tolist() == [5]
    assert np.linalg.norm(fit.mesh.vertices - body.truth, axis=1)[points].max() < 0.2


def test_arms_of_the_cactus() -> None:
    body = STANDARD["cactus"]()
    found = body.mesh.vertices[arms(body.mesh)]
    assert np.abs(found[:, 1]).max() == pytest.approx(ARM + THICK / 2)
    assert standard.measures("cactus", body, body.mesh.vertices)["arms"] == pytest.approx(0.0)
    longer = body.mesh.vertices * [1.0, 1.2, 1.0]
    assert standard.measures("cactus", body, longer)["arms"] == pytest.approx(20.0)


def test_marks_of_any_density() -> None:
    body = BODIES["beam"](0)
    some, every = density.marked(body, 16), density.marked(body, 10**6)
    assert len(some.marked) == len(set(some.marked)) == 16 + 7
    assert set(every.marked) >= set(body.side)
    assert set(some.marked) <= set(every.marked)
