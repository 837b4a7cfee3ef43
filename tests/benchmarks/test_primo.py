"""Coupled prisms: energies of known gaps, least energies, rigid motions and a strip that is rolled."""

import numpy as np
import pytest
import trimesh
from benchmarks.shapes.primo import Prisms
from scipy.spatial.transform import Rotation

HEIGHT = 2.0
HINGE = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.0, 3.0, 0.0], [2.0, -2.0, 0.0]])  # mm
HINGED = np.array([[0, 1, 2], [1, 0, 3]])
WEIGHT = 16.0 / (6.0 + 4.0)  # length^2 over both areas


def hinge() -> Prisms:
    return Prisms(HINGE, HINGED, np.array([0, 1, 2]), HEIGHT)


def corners(rotations: list[np.ndarray], offsets: list[list[float]]) -> np.ndarray:
    """Corners of the hinge's prisms, moved each on its own."""
    up = np.array([0.0, 0.0, 0.5 * HEIGHT])
    rest = [np.concatenate([HINGE[t] + up, HINGE[t] - up]) for t in HINGED]
    return np.concatenate([c @ r.T + o for c, r, o in zip(rest, rotations, offsets, strict=True)])


@pytest.mark.parametrize("degrees", [10.0, 60.0, 170.0])
def test_a_hinge_that_opens_by_an_angle(degrees: float) -> None:
    """The gap at v mm above the edge is 2 v sin(angle / 2): the mean square over the height is
    height^2 / 3 sin^2."""
    turn = Rotation.from_euler("x", degrees, degrees=True).as_matrix()
    found = hinge().energy(corners([np.eye(3), turn], [[0.0] * 3, [0.0] * 3]))
    assert found == pytest.approx(WEIGHT * HEIGHT**2 / 3 * np.sin(np.radians(degrees) / 2) ** 2)


def test_a_gap_that_is_the_same_all_over() -> None:
    found = hinge().energy(corners([np.eye(3)] * 2, [[0.0] * 3, [0.3, -0.4, 1.2]]))
    assert found == pytest.approx(WEIGHT * 1.3**2)


def test_a_gap_that_grows_along_the_edge() -> None:
    """A prism that turns in its plane about an end of the edge: the mean square of 2 x sin is
    length^2 4 sin^2 / 3."""
    turn = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    found = hinge().energy(corners([np.eye(3), turn], [[0.0] * 3, [0.0] * 3]))
    assert found == pytest.approx(WEIGHT * 4 * np.sin(np.radians(15)) ** 2 * 16 / 3)


def ball() -> tuple[np.ndarray, np.ndarray]:
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=10.0)
    return np.asarray(sphere.vertices), np.asarray(sphere.faces).astype(np.int64)


def test_a_rigid_motion_is_reproduced() -> None:
    x, faces = ball()
    points = np.array([0, 3, 7, 20])
    motion = Rotation.from_euler("xyz", [100, -50, 20], degrees=True)
    wanted = motion.apply(x) + [5.0, 1.0, -2.0]
    start = wanted + np.random.default_rng(0).normal(scale=0.3, size=x.shape)
    found = Prisms(x, faces, points, HEIGHT).least(start, wanted[points])
    assert np.abs(found - wanted).max() < 1e-3


def test_the_energy_falls_to_a_least_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every round lowers it, and no prisms turned a little, with the best translations, have less."""
    x, faces = ball()
    points = np.array([0, 1, 2, 3, 4, 5])
    targets = x[points] + np.random.default_rng(0).normal(size=(6, 3))
    prisms = Prisms(x, faces, points, HEIGHT)
    rounds: list[tuple[np.ndarray, float]] = []
    descended = prisms._descended

    def watched(*arguments: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rotations, placed = descended(*arguments)
        rounds.append((rotations, prisms.energy(placed)))
        return rotations, placed

    monkeypatch.setattr(prisms, "_descended", watched)
    found = prisms.least(x, targets)
    assert found[points] == pytest.approx(targets, abs=1e-4)
    energies = np.array([energy for _, energy in rounds])
    assert len(energies) > 2
    assert (np.diff(energies) < 0).all()
    rng = np.random.default_rng(1)
    for _ in range(10):
        turns = Rotation.from_rotvec(0.02 * rng.normal(size=(len(faces), 3))).as_matrix()
        assert prisms.energy(prisms.placed(turns @ rounds[-1][0], targets)) > energies[-1]


def test_a_strip_that_is_rolled_keeps_its_lengths() -> None:
    """A flat strip of 40 mm whose ends turn by a right angle: a quarter of a cylinder, without stretch."""
    along, across = np.linspace(0.0, 40.0, 21), np.linspace(0.0, 6.0, 4)
    x = np.stack([*np.meshgrid(along, across, indexing="ij"), np.zeros((21, 4))], axis=-1).reshape(-1, 3)
    low = (4 * np.arange(20)[:, None] + np.arange(3)).ravel()
    faces = np.concatenate([np.stack([low, low + 4, low + 5], 1), np.stack([low, low + 5, low + 1], 1)])
    arc = 40.0 / (0.5 * np.pi)
    angle = x[:, 0] / arc
    rolled = np.stack([arc * np.sin(angle), x[:, 1], arc * (1 - np.cos(angle))], axis=1)
    points = np.flatnonzero((x[:, 0] < 3.0) | (x[:, 0] > 37.0))
    start = x + (rolled - x) * 0.7
    found = Prisms(x, faces, points, HEIGHT).least(start, rolled[points])
    i, j = trimesh.Trimesh(x, faces, process=False).edges_unique.T
    before, after = (np.linalg.norm(p[i] - p[j], axis=1) for p in (x, found))
    assert after == pytest.approx(before, rel=0.01)
    assert np.abs(found - rolled).max() < 0.2
