"""Muscle and fat functions against what diffusion from a line and from a wall is known to give."""

import numpy as np
import pytest
from tests.anatomy.meshes import box

from handpipe.anatomy.templates.curves import PlacedCurve, PlacedMuscle
from handpipe.anatomy.templates.diffusion import Collocation, diffuse, stiffness, superlu
from handpipe.anatomy.templates.domain import Domain
from handpipe.core.errors import InputError
from handpipe.mesh.surfaces.curves import bishop_frames, resample
from handpipe.mesh.tets.embedding import Locator


def straight(start: list[float], end: list[float], rates: tuple[float, float] = (1.0, 1.0)) -> PlacedMuscle:
    points = resample(np.array([start, end], dtype=float), 40)
    frames = bishop_frames(points, np.array([0.0, 1.0, 0.0]))
    curve = PlacedCurve(points, np.ones(40), frames, np.tile([1.0, *rates], (40, 1)))
    return PlacedMuscle((curve,), (), (), None, None, "gradient")


@pytest.fixture(scope="module")
def slab() -> Domain:
    """40 x 40 mm across, 4 mm along x, skin on the four long sides."""
    mesh = box((3, 40, 40), (4.0, 40.0, 40.0))
    y, z = mesh.vertices[:, 1:].T
    return Domain(mesh, np.flatnonzero((y == 0) | (y == 40) | (z == 0) | (z == 40)), {})


THROUGH = [0.01, 20.2, 20.3], [3.99, 20.2, 20.3]


def test_stiffness_is_the_energy_of_linear_functions() -> None:
    mesh = box((3, 2, 4), (1.0, 2.0, 3.0))
    random = np.random.default_rng(0)
    slope, root = random.standard_normal(3), random.standard_normal((3, 3))
    u = mesh.vertices @ slope
    np.testing.assert_allclose(u @ stiffness(mesh) @ u, 6 * slope @ slope)
    tensor = root @ root.T
    of_tensor = stiffness(mesh, np.tile(tensor, (len(mesh.tets), 1, 1)))
    np.testing.assert_allclose(u @ of_tensor @ u, 6 * slope @ tensor @ slope)


def test_ways_through_tets_make_up_the_curve(slab: Domain) -> None:
    muscle = straight([0.5, 3, 5], [3.5, 30, 37])
    found = Collocation.sample(muscle.curves, Locator(slab.mesh))
    np.testing.assert_allclose(found.lengths.sum(), np.linalg.norm([3, 27, 32]), rtol=0.01)
    np.testing.assert_allclose(found.matrix(slab.mesh) @ slab.mesh.vertices, found.points, atol=1e-9)


def test_function_falls_like_the_logarithm_of_distance(slab: Domain) -> None:
    """A line along the middle of a square duct: away from line and walls it is a - b log r."""
    f = diffuse(slab, {"m": straight(*THROUGH)}, 1.0).values[:, 1]
    r = np.linalg.norm(slab.mesh.vertices[:, 1:] - [20.2, 20.3], axis=1)
    ring = (r > 3) & (r < 9)
    fit = np.polyfit(np.log(r[ring]), f[ring], 1)
    assert np.abs(np.polyval(fit, np.log(r[ring])) - f[ring]).max() < 0.03 * f.max()
    # Of a line in a square of side a, f = -slope log(1.0787 (a / 2) / r): the conformal radius of a square.
    np.testing.assert_allclose(np.exp(-fit[1] / fit[0]), 1.0787 * 20, rtol=0.02)


def test_values_at_curves_and_skin(slab: Domain) -> None:
    muscles = {"a": straight([0.01, 12, 20], [3.99, 12, 20]), "b": straight([0.01, 28, 20], [3.99, 28, 20])}
    functions = diffuse(slab, muscles, 0.7)
    locator = Locator(slab.mesh)
    points = {n: Collocation.sample(m.curves, locator) for n, m in muscles.items()}
    at = {n: p.matrix(slab.mesh) @ functions.values for n, p in points.items()}
    assert functions.names == ("fat", "a", "b")
    np.testing.assert_allclose(functions.values[slab.skin], [[0.7, 0, 0]] * len(slab.skin))
    np.testing.assert_allclose(at["a"].mean(axis=0), [0, 1, 0], atol=0.12)
    np.testing.assert_allclose(at["b"].mean(axis=0), [0, 0, 1], atol=0.12)


def test_spread_makes_ellipses(slab: Domain) -> None:
    """With rate 4 along y the values of a circle lie on an ellipse twice as wide as high."""
    f = diffuse(slab, {"m": straight(*THROUGH, (4.0, 1.0))}, 1.0).values[:, 1]
    y, z = (slab.mesh.vertices[:, 1:] - [20.2, 20.3]).T
    stretched = np.hypot(y / 2, z)
    ring = (stretched > 2) & (stretched < 4)
    fit = np.polyfit(np.log(stretched[ring]), f[ring], 1)
    assert np.std(np.polyval(fit, np.log(stretched[ring])) - f[ring]) < 0.02 * f.max()
    round_fit = np.polyfit(np.log(np.hypot(y, z)[ring]), f[ring], 1)
    assert np.std(np.polyval(round_fit, np.log(np.hypot(y, z)[ring])) - f[ring]) > 0.03 * f.max()


def test_one_factor_serves_all_without_spread(slab: Domain) -> None:
    made = []

    def counting(matrix):  # type: ignore[no-untyped-def]
        made.append(matrix.shape[0])
        return superlu(matrix)

    a, b = straight(*THROUGH), straight([0.01, 10, 10], [3.99, 10, 10])
    diffuse(slab, {"a": a, "b": b}, 1.0, factorise=counting)
    assert len(made) == 1
    diffuse(
        slab, {"a": a, "b": straight([0.01, 10, 10], [3.99, 10, 10], (2.0, 1.0))}, 1.0, factorise=counting
    )
    assert len(made) == 1 + 3  # the common one, the tensor's, and the one of the muscle with spread


def test_muscle_outside_the_domain_is_named(slab: Domain) -> None:
    with pytest.raises(InputError, match="muscles.lost"):
        diffuse(slab, {"lost": straight([10, 10, 10], [20, 10, 10])}, 1.0)
