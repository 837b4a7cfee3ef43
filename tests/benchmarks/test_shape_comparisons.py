"""Against other methods: bodies and measures are what they say; ours keeps its shape on finer meshes."""

from pathlib import Path

import numpy as np
import pytest
from benchmarks.shapes.__main__ import main
from benchmarks.shapes.comparison_bodies import BODIES, Body, rod, rod_body
from benchmarks.shapes.comparison_picture import draw
from benchmarks.shapes.comparisons import REACH, UNITS, Case
from benchmarks.shapes.other_methods import METHODS
from benchmarks.shapes.spikiness import Neighbourhood, mean_curvature
from PIL import Image
from scipy.spatial.transform import Rotation

from handpipe.core import metrics
from handpipe.core.arrays import Array
from handpipe.core.rigid import RigidTransform
from handpipe.mesh.tets.tetrahedra import TetMesh

RADIUS, LENGTH = 6.0, 40.0


def cylinder(places: Array) -> Array:
    return places * [LENGTH, RADIUS, RADIUS]


def bulging(places: Array) -> Array:
    """Half as wide again in the middle, in one direction."""
    wide = 1 + 0.5 * np.exp(-(((places[:, 0] - 0.5) / 0.25) ** 2))
    return cylinder(places) * np.column_stack([np.ones(len(places)), wide, np.ones(len(places))])


def bulging_rod(refinements: int) -> Body:
    return rod_body(refinements, cylinder, bulging, {4: 0}, layers=8)


def test_rods_are_filled() -> None:
    mesh = TetMesh(*rod(4, 3))
    assert mesh.volumes().min() > 0
    assert mesh.volumes().sum() == pytest.approx(0.5 * 24 * np.sin(2 * np.pi / 24))


@pytest.mark.parametrize("name", BODIES)
def test_marks_are_the_same_points_on_finer_meshes(name: str) -> None:
    coarse, fine = BODIES[name](0), BODIES[name](1)
    for ids in ("attached", "marked"):
        one, other = coarse.pairs(getattr(coarse, ids)), fine.pairs(getattr(fine, ids))
        assert np.allclose(one.points, other.points)
        assert np.allclose(one.targets, other.targets, atol=1e-6)
    assert len(fine.mesh.tets) == 8 * len(coarse.mesh.tets)
    assert fine.wanted.volumes().min() > 0
    assert set(fine.marked) <= set(fine.mesh.boundary_vertices())
    assert np.allclose(fine.truth[fine.attached], fine.mesh.vertices[fine.attached])  # attached as it was


def test_the_beam_bends_and_grows() -> None:
    body = BODIES["beam"](0)
    middle = np.isclose(body.mesh.vertices[:, 0], 30.0)
    assert np.ptp(body.truth[middle, 1]) == pytest.approx(2 * np.ptp(body.mesh.vertices[middle, 1]))
    end = np.isclose(body.mesh.vertices[:, 0], 60.0)
    assert np.ptp(body.truth[end, 2]) < 1e-9  # what faced x faces z


def test_mean_curvature_of_a_cylinder() -> None:
    body = bulging_rod(1)
    found = mean_curvature(body.mesh.boundary())[body.side]
    assert found == pytest.approx(np.full(len(body.side), 0.5 / RADIUS), rel=0.02)


def shaped(refinements: int, height: float, width: float | None) -> tuple[Neighbourhood, Array]:
    """A bump of that width (mm) at a mark, or a spike as wide as a triangle."""
    body = bulging_rod(refinements)
    x = body.mesh.vertices
    near = Neighbourhood.around(body.mesh.boundary(), body.marked[:1], body.side, REACH)
    distance = np.linalg.norm(x - x[body.marked[0]], axis=1)
    bump = (distance == 0.0) if width is None else np.exp(-((distance / width) ** 2))
    outwards = x * [0.0, 1.0, 1.0] / RADIUS
    return near, x + height * bump[:, None] * outwards


def test_a_smooth_bump_is_as_spiky_on_any_mesh() -> None:
    middle, fine = ((near, x) for near, x in (shaped(k, 1.0, 4.0) for k in (1, 2)))
    assert fine[0].spikiness(fine[1]) == pytest.approx(middle[0].spikiness(middle[1]), rel=0.1)
    wanted, found = (near.normal_errors(x, near.surface.vertices).mean() for near, x in (middle, fine))
    assert found == pytest.approx(wanted, rel=0.2)


def test_a_spike_is_spikier_on_a_finer_mesh() -> None:
    found = [near.spikiness(x) for near, x in (shaped(k, 1.0, None) for k in range(3))]
    assert found[1] > 1.5 * found[0]
    assert found[2] > 1.25 * found[1]


def test_normals_turn_with_the_body() -> None:
    body = bulging_rod(0)
    near = Neighbourhood.around(body.mesh.boundary(), body.marked, body.side, REACH)
    turned = body.mesh.vertices @ Rotation.from_euler("x", 20, degrees=True).as_matrix().T
    assert near.normal_errors(turned, body.mesh.vertices) == pytest.approx(20.0)
    assert near.spikiness(body.truth) == pytest.approx(
        near.spikiness(body.truth @ Rotation.from_euler("y", 70, degrees=True).as_matrix())
    )


STRAIGHT = {
    "biharmonic_volume",
    "biharmonic_surface",
    "bounded_biharmonic",
    "bending_incremental",
    "elastic_incremental",
}  # methods that know no rotation, or follow the straight path of the marks


@pytest.mark.parametrize("method", [m for m in METHODS if m not in STRAIGHT])
def test_methods_follow_a_rigid_motion(method: str) -> None:
    """All others know rotations, or affine maps."""
    body = bulging_rod(0)
    motion = RigidTransform(Rotation.from_euler("yz", [50, 20], degrees=True).as_matrix(), np.ones(3))
    moved = Body(body.mesh, motion(body.mesh.vertices), body.attached, body.marked, body.side)
    x = METHODS[method](moved)
    outer = body.mesh.boundary_vertices()
    assert np.abs(x - moved.truth)[outer].max() < 0.02


def test_ours_keeps_its_shape_where_others_come_to_a_point() -> None:
    found: dict[str, list[dict[str, float]]] = {"plastic": [], "arap_volume": [], "elastic": []}
    truth = []
    for refinement in range(2):
        body = bulging_rod(refinement)
        case = Case(body, Neighbourhood.around(body.mesh.boundary(), body.marked, body.side, REACH))
        truth.append(case.near.spikiness(body.truth))
        for method, measured in found.items():
            measured.append(case.measures(METHODS[method](body)))
    ours = found.pop("plastic")
    assert all(m["marks_max"] < 0.05 for m in ours)
    assert ours[1]["spikiness"] < 1.15 * ours[0]["spikiness"]
    assert ours[1]["spikiness"] == pytest.approx(truth[1], rel=0.2)
    for others in found.values():
        assert others[1]["spikiness"] > 1.4 * others[0]["spikiness"]
        assert others[1]["surface_max"] > 2 * ours[1]["surface_max"]


def test_figures_of_every_method(tmp_path: Path) -> None:
    output = tmp_path / "shapes.json"
    main(["comparisons", "--quick", "--output", str(output), "--threads", "1"])
    figures = metrics.read(output)
    for body in BODIES:
        for method in METHODS:
            assert all(f"comparison_{body}_{method}_{measure}_0" in figures for measure in UNITS)
        assert abs(figures[f"comparison_{body}_plastic_volume_0"][0]) < 3.0
        assert figures[f"comparison_{body}_elastic_volume_0"][0] < -20.0


def test_the_picture_shows_the_bodies(tmp_path: Path) -> None:
    body = BODIES["muscle"](0)
    path = tmp_path / "picture.png"
    draw(path, {"muscle": {"truth": body.truth, "plastic": body.truth}}, {"muscle": body}, {}, 0)
    red, green, _ = np.moveaxis(np.asarray(Image.open(path).convert("RGB")).astype(int), 2, 0)
    columns = np.flatnonzero((red > green + 40).any(axis=0))
    assert len(columns) > 300  # two bodies side by side
