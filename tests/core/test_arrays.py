"""Unit vectors against complex numbers and against the definition of each place that used its own."""

import numpy as np

from handpipe.core.arrays import unit_vectors


def test_vectors_of_a_plane_are_complex_numbers_of_length_one() -> None:
    angles = np.linspace(0, 6, 50)
    lengths = np.geomspace(1e-12, 1e12, 50)
    numbers = lengths * np.exp(1j * angles)
    found = unit_vectors(np.stack([numbers.real, numbers.imag, np.zeros(50)], axis=-1))
    np.testing.assert_allclose(found[:, 0] + 1j * found[:, 1], np.exp(1j * angles), rtol=1e-14)


def test_zero_stays_zero_beside_others() -> None:
    found = unit_vectors(np.array([[[0.0, 0, 0], [3, 0, 4]]]))
    np.testing.assert_array_equal(found, [[[0, 0, 0], [0.6, 0, 0.8]]])
