"""What interpolation over poses misses, against random functions of which everything is known."""

import numpy as np
import pytest

from handpipe.skeleton.posing import PoseSpace, left_out_weights, prediction_variance


def space(places: np.ndarray, kind: str = "rbf") -> PoseSpace:
    return PoseSpace(("a", "b"), "a", places, tuple(map(str, range(len(places)))), kind)


def test_between_examples_on_a_line_it_is_the_variance_of_a_brownian_bridge() -> None:
    known = space(np.array([[0.0], [0.4], [1.0], [1.8], [2.0]]))
    for a, x, b in ((0.0, 0.1, 0.4), (0.4, 0.9, 1.0), (1.0, 1.4, 1.8)):
        expected = 2 * (x - a) * (b - x) / (b - a)
        assert prediction_variance(known, np.array([x])) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("kind", ["rbf", "exponential", "inverse-square", "inverse-distance"])
def test_it_is_zero_at_the_examples_and_grows_without_bound_away_from_them(kind: str) -> None:
    places = np.vstack([np.zeros(3), np.random.default_rng(0).uniform(-0.2, 1.2, (6, 3))])
    known = space(places, kind)
    assert all(prediction_variance(known, place) < 1e-8 for place in places)
    outward = places.mean(axis=0) + np.array([0.6, 0.6, 0.6])
    far = [prediction_variance(known, outward * length) for length in (1.0, 2.0, 4.0, 8.0, 16.0)]
    assert (np.diff(far) > 0).all() and far[-1] > 5 * far[0]


@pytest.mark.parametrize("kind", ["rbf", "exponential", "inverse-square"])
def test_drawn_functions_are_missed_by_as_much(kind: str) -> None:
    """Brownian functions with a trend, zero at rest: mean square errors of 20000 of them."""
    rng = np.random.default_rng(3)
    places = np.vstack([np.zeros(3), rng.uniform(0.0, 1.2, (6, 3))])
    new = rng.uniform(-0.3, 1.6, (5, 3))
    points = np.vstack([places, new])
    size = np.linalg.norm(points, axis=1)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    covariance = size[:, None] + size[None] - apart + 2 * points @ points.T
    drawn = rng.multivariate_normal(np.zeros(len(points)), covariance, 20000, method="eigh")
    known = space(places, kind)
    for i, pose in enumerate(new):
        missed = drawn[:, len(places) + i] - drawn[:, : len(places)] @ known.weights_at(pose)
        assert prediction_variance(known, pose) == pytest.approx(np.mean(missed**2), rel=0.05)
    for number, weights, variance in left_out_weights(known):
        missed = drawn[:, number] - drawn[:, : len(places)] @ weights
        assert weights[number] == 0
        assert variance == pytest.approx(np.mean(missed**2), rel=0.05)


def test_the_example_at_rest_is_never_left_out() -> None:
    known = space(np.array([[0.3, 0.0], [0.0, 0.0], [1.0, 0.2]]))
    assert [number for number, _, _ in left_out_weights(known)] == [0, 2]
