import numpy as np
import pytest
from skimage import segmentation

from handpipe.core.errors import ConvergenceError
from handpipe.imaging.segmentation.random_walker import INSIDE, OUTSIDE, Stop, random_walker


def ball_in_shell(shape=(24, 22, 19), noise=0.05):
    """Bright ball, dark shell, bright or grey outside; seeds in the ball and at the rim."""
    centred = np.moveaxis(np.indices(shape), 0, -1) - np.array(shape) / 2
    radius = np.linalg.norm(centred, axis=-1)
    outside = np.where(centred[..., 2] > 0, 0.9, 0.4)
    values = np.where(radius < 6, 1.0, np.where(radius < 8, 0.05, outside))
    values = values + noise * np.random.default_rng(0).standard_normal(shape)
    seeds = np.zeros(shape, np.uint8)
    seeds[radius < 2] = INSIDE
    seeds[radius > 9.3] = OUTSIDE
    return values, seeds


def test_agrees_with_scikit_image() -> None:
    values, seeds = ball_in_shell()
    beta = 60.0
    other = segmentation.random_walker(
        values, seeds.astype(int), beta=beta * 10 * values.std(), mode="bf", return_full_prob=True
    )
    # Its least weight is 1e-10, ours 1e-6: what leaks through the shell is below the usual tolerance of 1e-3.
    assert np.abs(random_walker(values, seeds, beta, stop=Stop(1e-6)) - other[0]).max() < 3e-4


def test_is_linear_between_two_plates() -> None:
    """Without contrast the probability is harmonic: linear between two seeded planes."""
    seeds = np.zeros((21, 12, 10), np.uint8)
    seeds[0], seeds[-1] = INSIDE, OUTSIDE
    probability = random_walker(np.ones(seeds.shape), seeds, 50.0, stop=Stop(1e-7))
    expected = np.broadcast_to(np.linspace(1, 0, 21)[:, None, None], seeds.shape)
    np.testing.assert_allclose(probability, expected, atol=1e-5)


def test_obeys_the_maximum_principle_and_symmetry() -> None:
    values, seeds = ball_in_shell()
    swapped = np.array([0, OUTSIDE, INSIDE], np.uint8)[seeds]
    p = random_walker(values, seeds, 100.0, stop=Stop(1e-6))
    q = random_walker(values, swapped, 100.0, stop=Stop(1e-6))
    assert p.min() >= 0
    assert p.max() <= 1
    np.testing.assert_allclose(p + q, 1, atol=1e-4)


def test_starting_at_the_solution_stays_there() -> None:
    values, seeds = ball_in_shell()
    p = random_walker(values, seeds, 100.0, stop=Stop(1e-7))
    again = random_walker(values, seeds, 100.0, start=p, stop=Stop(tolerance=1e-5, max_iterations=1))
    np.testing.assert_allclose(again, p, atol=1e-5)


def test_too_few_iterations_are_an_error() -> None:
    values, seeds = ball_in_shell()
    with pytest.raises(ConvergenceError):
        random_walker(values, seeds, 100.0, stop=Stop(tolerance=1e-8, max_iterations=2))
