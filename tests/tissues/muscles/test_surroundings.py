"""Points go where all around them has gone."""

import numpy as np

from handpipe.tissues.muscles.fitting.surroundings import carried_along

from .shapes import bent


def shell() -> np.ndarray:
    """Points on a box of 24 x 10 x 10 mm."""
    points = np.random.default_rng(1).uniform([0, -5, -5], [24, 5, 5], (1500, 3))
    side = np.argmax(np.abs(points[:, 1:]), axis=1) + 1
    rows = np.arange(len(points))
    points[rows, side] = 5.0 * np.sign(points[rows, side])
    return points


def inside() -> np.ndarray:
    return np.random.default_rng(2).uniform([4, -2, -2], [20, 2, 2], (200, 3))


def test_affine_motions_are_met_exactly():
    matrix = np.array([[0.8, -0.5, 0.1], [0.4, 0.9, 0.0], [0.0, 0.2, 1.1]])
    points, around = inside(), shell()
    np.testing.assert_allclose(
        carried_along(points, around, around @ matrix.T + 3.0), points @ matrix.T + 3.0
    )


def test_a_bend_is_followed_from_around():
    points, around = inside() + [0, 2, 2], shell() + [0, 2, 2]
    posed, truth = (
        bent(np.vstack([around, [[24.0, 2, 2]]]), 1.0)[:-1],
        bent(np.vstack([points, [[24.0, 2, 2]]]), 1.0),
    )
    found = carried_along(points, around, posed)
    assert np.linalg.norm(truth[:-1] - points, axis=1).max() > 5.0
    assert np.linalg.norm(found - truth[:-1], axis=1).max() < 0.5
