"""The logarithm of the stretch against scipy's matrix functions and finite differences."""

import numpy as np
import pytest
from scipy.linalg import logm, polar
from scipy.spatial.transform import Rotation

from handpipe.fem.elements.plasticity import to_matrices
from handpipe.shapes.strains.stretch import log_stretch


def gradients(seed: int = 0) -> np.ndarray:
    f = np.eye(3) + 0.4 * np.random.default_rng(seed).standard_normal((20, 3, 3))
    f[0], f[1] = np.eye(3), np.diag([1.3, 1.3, 0.8])  # equal stretches
    return f[np.linalg.det(f) > 0.05]


def test_equals_the_logarithm_of_the_polar_factor():
    f = gradients()
    expected = np.array([logm(polar(a)[1]).real for a in f])
    assert to_matrices(log_stretch(f)[0]) == pytest.approx(expected, abs=1e-10)


def test_does_not_see_rotations():
    f = gradients()
    turned = Rotation.from_rotvec([0.3, -1.2, 2.0]).as_matrix() @ f
    assert log_stretch(turned)[0] == pytest.approx(log_stretch(f)[0], abs=1e-12)


def test_derivative_agrees_with_differences():
    f = gradients()
    derivative = log_stretch(f)[1]
    for k in range(9):
        step = np.zeros(9)
        step[k] = 1e-6
        plus, minus = (log_stretch(f + s * step.reshape(3, 3))[0] for s in (1, -1))
        assert derivative[:, :, k] == pytest.approx((plus - minus) / 2e-6, abs=1e-7)
