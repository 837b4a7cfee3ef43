"""Interpolated images: what was acquired is told from the spectrum, and thin shells in them are named."""

import numpy as np
import pytest
import trimesh

from handpipe.imaging.bone_surfaces import blurred_shells
from handpipe.imaging.volumes import Volume, acquired_voxels
from handpipe.mesh.surfaces import Surface

SPACING = np.array([0.8, 0.6, 0.5])  # mm


def ellipsoids(noise: float) -> np.ndarray:
    """Bright ellipsoids with edges of partial volume, in an image with noise (96, 80, 64)."""
    rng = np.random.default_rng(5)
    shape = (96, 80, 64)
    grid = np.stack(np.meshgrid(*(np.arange(n, dtype=float) for n in shape), indexing="ij"), -1)
    image = np.zeros(shape)
    for level in (0.9, 0.5, 1.0, 0.3):
        middle, radii = rng.uniform(0.35, 0.65, 3) * shape, rng.uniform(0.1, 0.3, 3) * shape
        distance = (np.linalg.norm((grid - middle) / radii, axis=-1) - 1.0) * radii.min()
        image += np.clip(0.5 - distance, 0.0, 1.0) * (level - image)
    return image + noise * rng.standard_normal(shape)


def interpolated(values: np.ndarray, shares: tuple[float, float]) -> np.ndarray:
    """Magnitude of an image whose waves beyond a share of the first two axes' finest ones are zero."""
    k = np.fft.fftn(values, axes=(0, 1))
    for axis, share in enumerate(shares):
        keep = np.abs(np.fft.fftfreq(values.shape[axis])) <= 0.5 * share
        k *= keep.reshape([-1 if a == axis else 1 for a in range(3)])
    return np.abs(np.fft.ifftn(k, axes=(0, 1)))


def volume(values: np.ndarray) -> Volume:
    return Volume(values.astype(np.float32), np.diag([*SPACING, 1.0]))


@pytest.mark.parametrize("noise", [0.0, 0.03])
@pytest.mark.parametrize("shares", [(0.6, 1.0), (0.75, 1.0), (1.0, 0.55)])
def test_the_end_of_the_spectrum_tells_what_was_acquired(shares: tuple[float, float], noise: float) -> None:
    found = acquired_voxels(volume(interpolated(ellipsoids(noise), shares)))
    assert found == pytest.approx(SPACING / np.array([*shares, 1.0]), rel=0.05)


@pytest.mark.parametrize("noise", [0.0, 0.03, 0.1])
def test_an_image_that_is_not_interpolated_keeps_its_voxels(noise: float) -> None:
    assert acquired_voxels(volume(np.abs(ellipsoids(noise)))) == pytest.approx(SPACING)


def test_a_thin_shell_in_an_interpolated_image_is_named() -> None:
    def ball(radius: float) -> Surface:
        mesh = trimesh.creation.icosphere(4, radius)
        return Surface(np.array(mesh.vertices), np.array(mesh.faces))

    marrows = {"thin": ball(5.0), "thick": ball(5.0)}
    wholes = {"thin": ball(6.0), "thick": ball(7.0)}
    image = ellipsoids(0.02)
    assert blurred_shells(volume(np.abs(image)), marrows, wholes) == {}
    found = blurred_shells(volume(interpolated(image, (0.6, 1.0))), marrows, wholes)  # 1.3 mm
    assert list(found) == ["thin"]
    assert "looks 1.0 mm thick, hardly more than the voxels of 1.3 mm" in found["thin"]
