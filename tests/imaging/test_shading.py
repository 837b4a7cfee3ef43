"""A known field on known tissues: most of it goes."""

import numpy as np

from handpipe.imaging.volumes.shading import without_shading
from handpipe.imaging.volumes.volume import Volume


def test_most_of_a_coils_field_is_removed() -> None:
    i, j, k = np.indices((64, 48, 64)).astype(float)
    inside = ((j - 24) ** 2 + (i - 32) ** 2) < 20**2
    bone = ((j - 24) ** 2 + (i - 32) ** 2) < 8**2
    tissue = np.where(inside, np.where(bone, 100.0, 60.0), 1.0)
    field = np.exp(1.2 * (j - 24) / 48)
    noise = np.random.default_rng(0).normal(0, 1.0, tissue.shape)
    volume = Volume((tissue * field + noise).astype(np.float32), np.diag([0.5, 0.5, 0.5, 1.0]))
    even = without_shading(volume)

    def spread(values):  # of one tissue's level over the places, whatever the common factor
        return np.log(values[inside & ~bone]).std()

    assert spread(even.values) < 0.35 * spread(volume.values)
    contrast = np.median(even.values[bone]) / np.median(even.values[inside & ~bone])
    assert abs(contrast - 100 / 60) < 0.12
