import numpy as np
import pytest

from handpipe.mesh.surfaces.smoothing import laplacian, taubin

from .shapes import sphere


@pytest.mark.parametrize("smooth", [laplacian, taubin])
def test_noise_goes_and_the_volume_stays(smooth):
    shape = sphere(10, 4)
    noise = np.random.default_rng(0).normal(0, 0.1, len(shape.vertices))
    rough = shape.moved(shape.vertices * (1 + noise / 10)[:, None])
    result = smooth(rough, 10)
    assert np.linalg.norm(result.vertices, axis=1).std() < 0.4 * np.linalg.norm(rough.vertices, axis=1).std()
    assert result.volume() == pytest.approx(rough.volume(), rel=1e-3)


def test_taubin_keeps_a_low_wave_that_laplacian_smoothing_flattens():
    shape = sphere(10, 4)
    wave = shape.vertices[:, 2] ** 2 / 100 - 1 / 3
    bumpy = shape.moved(shape.vertices * (1 + 0.1 * wave)[:, None])

    def amplitude(surface):
        return np.polyfit(wave, np.linalg.norm(surface.vertices, axis=1), 1)[0]

    before = amplitude(bumpy)
    assert abs(amplitude(taubin(bumpy, 60)) - before) < 0.5 * abs(amplitude(laplacian(bumpy, 120)) - before)
