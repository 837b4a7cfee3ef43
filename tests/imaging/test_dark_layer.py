import numpy as np
import pytest
from scipy.special import erf

from handpipe.imaging.evidence.dark_layer import fit_dark_layers, fit_dark_level

OFFSETS = np.arange(-1.8, 3.2, 0.2)
BLUR, NOISE, DARK = 0.25, 0.03, 0.06


def step(s):
    return 0.5 * (1 + erf(s / BLUR / np.sqrt(2)))


def profiles(inner, thickness, outside, count=400):
    """Blurred inner tissue, layer, outer tissue with white noise; inner faces (n, 1)."""
    s = OFFSETS - inner
    clean = 1.0 * (1 - step(s)) + DARK * (step(s) - step(s - thickness)) + outside * step(s - thickness)
    return clean + NOISE * np.random.default_rng(0).standard_normal((count, len(OFFSETS)))


@pytest.mark.parametrize("outside", [0.45, 0.9])
@pytest.mark.parametrize("thickness", [0.25, 0.5, 1.0, 1.8])
def test_layers_thinner_than_a_voxel_are_measured_without_bias(thickness, outside) -> None:
    inner = np.random.default_rng(1).uniform(-0.3, 0.3, (400, 1))
    fit = fit_dark_layers(profiles(inner, thickness, outside), OFFSETS, DARK, BLUR, NOISE, 0.6, 0.8)
    trusted = fit.thickness_confidence > 0.5
    assert trusted.mean() > 0.7
    assert abs((fit.inner - inner[:, 0])[trusted].mean()) < 0.01
    assert abs((fit.thickness - thickness)[trusted].mean()) < 0.02
    assert np.abs((fit.thickness - thickness)[trusted]).mean() < 0.06


def test_a_layer_without_end_is_not_trusted() -> None:
    """A tendon against the bone: dark to the end of the profile."""
    fit = fit_dark_layers(profiles(np.zeros((400, 1)), 9.0, 0.9), OFFSETS, DARK, BLUR, NOISE, 0.6, 0.8)
    assert (fit.thickness_confidence < 0.1).mean() > 0.95
    assert (fit.inner_confidence > 0.5).mean() > 0.95
    assert np.abs(fit.inner).mean() < 0.03


def test_the_layers_level_is_found() -> None:
    candidates = np.arange(0.0, 0.2, 0.03)
    found = fit_dark_level(profiles(np.zeros((400, 1)), 0.8, 0.7), OFFSETS, candidates, BLUR, NOISE, 0.6, 0.8)
    assert abs(found - DARK) < 0.031
