"""Fibre directions against analytic fields of muscles of the kinds that anatomists name."""

import numpy as np
import pytest
from tests.anatomy.meshes import box

from handpipe.anatomy.templates.curves import PlacedAttachment, PlacedCurve, PlacedMuscle
from handpipe.anatomy.templates.diffusion import Collocation
from handpipe.anatomy.templates.fibres import fibres, flow_fibres, gradient_fibres
from handpipe.core.errors import InputError
from handpipe.mesh.surfaces.curves import bishop_frames, resample
from handpipe.mesh.tets.embedding import Locator
from handpipe.mesh.tets.tetrahedra import TetMesh


def curve(points: np.ndarray) -> PlacedCurve:
    fine = resample(np.asarray(points, dtype=float), 50)
    ones = np.ones(50)
    return PlacedCurve(fine, ones, bishop_frames(fine, np.array([0.1, 0.2, 1.0])), np.ones((50, 3)))


def collocated(mesh: TetMesh, *lines: np.ndarray) -> Collocation:
    return Collocation.sample([curve(line) for line in lines], Locator(mesh))


def mean_angle(mesh: TetMesh, directions: np.ndarray, expected: np.ndarray) -> float:
    """Mean angle in degrees over the volume."""
    cosine = np.einsum("mi,mi->m", directions, expected / np.linalg.norm(expected, axis=1, keepdims=True))
    return float(np.average(np.degrees(np.arccos(np.clip(cosine, -1, 1))), weights=mesh.volumes()))


def rounded(n: int) -> TetMesh:
    """A cylinder of radius and length 1 about the x axis from a box, squares going to circles."""
    mesh = box((3 * n, n, n), (1.0, 2.0, 2.0))
    x, y, z = (mesh.vertices - [0, 1, 1]).T
    u, v = y * np.sqrt(1 - z**2 / 2), z * np.sqrt(1 - y**2 / 2)
    return TetMesh(np.column_stack([x, u, v]), mesh.tets)


def fusiform() -> tuple[TetMesh, np.ndarray]:
    """A belly of 60 mm, 12 mm thick in the middle and 4 mm at the ends; fibres keep their share of the
    radius.
    """
    mesh = rounded(8)
    x, share = 60 * mesh.vertices[:, 0], mesh.vertices[:, 1:]
    radius, _ = belly(x)
    mesh = TetMesh(np.column_stack([x, radius[:, None] * share]), mesh.tets)
    centre = mesh.vertices[mesh.tets].mean(axis=1)
    radius, slope = belly(centre[:, 0])
    return mesh, np.column_stack([np.ones(len(centre)), (slope / radius)[:, None] * centre[:, 1:]])


def belly(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Radius and its slope."""
    phase = 2 * np.pi * x / 60
    return 2 + 2 * (1 - np.cos(phase)), 4 * np.pi / 60 * np.sin(phase)


def triangular() -> tuple[TetMesh, np.ndarray]:
    """A fan of 80 degrees, from 8 to 40 mm from the point where its fibres would meet, 6 mm thick."""
    mesh = box((16, 12, 3))
    radius = 8 + 32 * mesh.vertices[:, 0]
    angle = np.radians(80) * (mesh.vertices[:, 1] - 0.5)
    vertices = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 6 * mesh.vertices[:, 2]])
    mesh = TetMesh(vertices, mesh.tets)
    centre = vertices[mesh.tets].mean(axis=1)
    return mesh, centre * [1, 1, 0]


PENNATION = np.radians(20)


def pennate() -> tuple[TetMesh, np.ndarray]:
    """Two sheets of tendon of 40 mm, 10 mm apart, with fibres between at 20 degrees to them."""
    mesh = box((20, 6, 6), (40.0, 10.0, 10.0))
    sheared = mesh.vertices.copy()
    sheared[:, 0] += sheared[:, 2] / np.tan(PENNATION)
    direction = np.array([np.cos(PENNATION), 0, np.sin(PENNATION)])
    return TetMesh(sheared, mesh.tets), np.broadcast_to(direction, (len(mesh.tets), 3))


def test_fusiform() -> None:
    mesh, expected = fusiform()
    x = mesh.vertices[:, 0]
    directions, potential = gradient_fibres(
        mesh,
        collocated(mesh, [[0, 0, 0], [60, 0, 0]]),
        np.flatnonzero(x == 0),
        np.flatnonzero(x == x.max()),
    )
    assert mean_angle(mesh, directions, expected) < 5
    assert potential.min() >= 0 and potential.max() <= 1


def test_triangular() -> None:
    mesh, expected = triangular()
    radius = np.linalg.norm(mesh.vertices[:, :2], axis=1)
    directions, _ = gradient_fibres(
        mesh,
        collocated(mesh, [[40, 0, 3], [8, 0, 3]]),
        np.flatnonzero(radius > 40 - 1e-9),
        np.flatnonzero(radius < 8 + 1e-9),
    )
    assert mean_angle(mesh, directions, -expected) < 5


def pennate_muscle(kind: str) -> tuple[TetMesh, np.ndarray, PlacedMuscle]:
    """Its sheets are attachments; three curves lead from one to the other."""
    mesh, expected = pennate()
    shift = 10 / np.tan(PENNATION)
    lines = [[[x, 5, 0.0], [x + shift, 5, 10.0]] for x in (5, 20, 35)]
    sheet = np.array([[[x, y] for x in (0, 40)] for y in (0, 10)], dtype=float).reshape(-1, 2)[[0, 1, 3, 2]]
    origin = np.column_stack([sheet, np.zeros(4)])
    insertion = origin + [shift, 0, 10]
    muscle = PlacedMuscle(
        tuple(curve(line) for line in lines),
        (PlacedAttachment(origin, 5.5),),
        (PlacedAttachment(insertion, 5.5),),
        None,
        None,
        kind,  # type: ignore[arg-type]
    )
    return mesh, expected, muscle


def test_pennate() -> None:
    mesh, expected, muscle = pennate_muscle("flow")
    z = mesh.vertices[:, 2]
    sheets = np.flatnonzero((z == 0) | (z == 10))
    found = fibres(mesh, muscle, attached=sheets)
    assert set(found.origin) == set(np.flatnonzero(z == 0))
    assert mean_angle(mesh, found.directions, expected) < 5


def test_gradients_cannot_be_pennate() -> None:
    """Why there is a flow: the gradient of a potential leaves its attachments at right angles."""
    mesh, expected, muscle = pennate_muscle("gradient")
    sheets = np.flatnonzero((mesh.vertices[:, 2] == 0) | (mesh.vertices[:, 2] == 10))
    assert mean_angle(mesh, fibres(mesh, muscle, attached=sheets).directions, expected) > 20


def test_gradient_follows_the_curve() -> None:
    """Between two corners of a slab the way is straight; a bent curve bends the gradient beside it."""
    mesh = box((20, 20, 2), (20.0, 20.0, 2.0))
    near = [np.flatnonzero(np.linalg.norm(mesh.vertices[:, :2] - c, axis=1) < 3) for c in ([0, 0], [20, 20])]
    bent = collocated(mesh, [[0, 1, 1], [10, 4, 1], [16, 10, 1], [19, 20, 1]])
    middle = (bent.points[:, 0] > 4) & (bent.points[:, 1] < 16)
    angles = []
    for alignment in (0.0, 50.0):
        directions, _ = gradient_fibres(mesh, bent, near[0], near[1], alignment=alignment)
        cosine = np.einsum("mi,mi->m", directions[bent.tets], bent.frames[:, 0])
        angles.append(np.degrees(np.arccos(np.clip(cosine, -1, 1)))[middle].mean())
    assert angles[1] < 0.4 * angles[0]


def test_flow_is_conserved_and_stays_inside() -> None:
    """Without leakage's help the flow through every section of the fusiform muscle is the same."""
    mesh, _ = fusiform()
    x = mesh.vertices[:, 0]
    ends = np.flatnonzero(x == 0), np.flatnonzero(x == x.max())
    directions, _ = flow_fibres(mesh, collocated(mesh, [[0, 0, 0], [60, 0, 0]]), *ends)
    faces, owners = mesh.boundary_faces()
    points = mesh.vertices[faces]
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    side = np.abs(normal[:, 0]) < 0.9
    assert np.degrees(np.arcsin(np.abs((directions[owners] * normal).sum(axis=1)[side]))).mean() < 5


def test_attachment_out_of_reach_is_named() -> None:
    mesh, _, muscle = pennate_muscle("flow")
    far = PlacedMuscle(
        muscle.curves,
        (PlacedAttachment(np.array([[0.0, 0, -50]]), 3.0),),
        muscle.insertions,
        None,
        None,
        "flow",
    )
    with pytest.raises(InputError, match="origin.*reach"):
        fibres(mesh, far)


@pytest.mark.parametrize("reach", [1.5, 2.001])  # of nothing, and of the nearest vertex alone
def test_an_end_hardly_in_reach_is_a_patch_and_not_a_hinge(reach: float) -> None:
    mesh, _, muscle = pennate_muscle("flow")
    lowest = mesh.vertices[mesh.vertices[:, 2].argmin()]
    place = lowest - [0, 0, 2.0]
    beside = PlacedMuscle(
        muscle.curves, (PlacedAttachment(place[None], reach),), muscle.insertions, None, None, "flow"
    )
    held = mesh.vertices[fibres(mesh, beside).origin]
    assert np.linalg.matrix_rank(held - held.mean(axis=0), tol=1e-6) >= 2
    assert np.linalg.norm(held - place, axis=1).max() <= 2.0 + mesh.edge_length()
