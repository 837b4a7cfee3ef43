"""Intensities in units of a local level, and the coarse images of a search."""

import numpy as np
import pytest

from handpipe.imaging.evidence.marrow_evidence import MarrowEvidence, blocks, normalised
from handpipe.imaging.volumes.volume import Volume

SHAPE = (61, 50, 42)
SPACING = np.array([0.5, 0.5, 0.8])


def scan(noise: float = 0.0) -> tuple[Volume, np.ndarray]:
    """Bright rods in a dark shell and grey tissue, under a bias field and a gain; and what it is without."""
    x, y, z = np.moveaxis(np.moveaxis(np.indices(SHAPE), 0, -1) * SPACING, -1, 0)
    clean = np.full(SHAPE, 0.45)
    for middle in (7.0, 17.0):
        radius = np.hypot(y - middle, z - 16)
        clean[radius < 4] = 0.08
        clean[radius < 3] = 1.0
    field = 700 * (1 + 0.3 * (x / 30 - 0.5) + 0.2 * (y / 25 - 0.5))
    noisy = clean + noise * np.random.default_rng(0).standard_normal(SHAPE)
    return Volume((noisy * field).astype(np.float32), np.diag([*SPACING, 1.0])), clean


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_gain_and_bias_drop_out(noise):
    volume, clean = scan(noise)
    levels = normalised(volume)
    for tissue in (1.0, 0.45, 0.08):
        assert np.median(levels[clean == tissue]) == pytest.approx(tissue, abs=0.1)
    spread = np.quantile(levels[clean == 1.0], [0.05, 0.95])
    assert np.ptp(spread) < 0.2 + 4 * noise  # the field itself spreads over 0.5


def test_blocks_keep_their_place():
    volume, _ = scan()
    places = volume.to_world(np.moveaxis(np.indices(SHAPE), 0, -1).reshape(-1, 3))
    ramp = volume.like((places @ [1.0, 2.0, -0.5]).reshape(SHAPE))
    coarse = blocks(ramp, np.array([2, 2, 1]), np.mean)
    assert coarse.shape == (30, 25, 42)
    index = np.moveaxis(np.indices(coarse.shape), 0, -1).reshape(-1, 3)
    expected = coarse.to_world(index) @ [1.0, 2.0, -0.5]
    np.testing.assert_allclose(coarse.values.ravel(), expected, atol=1e-4)


def test_the_coarse_images_forgive_a_millimetre():
    """A place in the rod is bright, and within a millimetre and a half of the shell something is dark."""
    volume, _ = scan()
    evidence = MarrowEvidence.measure(volume)
    inside, shell, far = ([15.0, 7.0 + r, 16.0] for r in (0.0, 3.5, 8.0))
    assert evidence.bright.sample(np.array([inside]))[0] > 0.85
    for shift in (-1.0, 0.0, 1.0):
        assert evidence.dark.sample(np.array([shell]) + [0, shift, 0])[0] < 0.2
    assert evidence.dark.sample(np.array([far]))[0] < evidence.bright.sample(np.array([inside]))[0]
