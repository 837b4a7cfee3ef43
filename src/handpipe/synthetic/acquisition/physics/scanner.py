"""The scanner: a posed subject becomes a magnitude image by signal equations, structures and artefacts."""

from __future__ import annotations

from collections.abc import Sequence as Numbers

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from handpipe.synthetic.acquisition.image import VoxelGrid
from handpipe.synthetic.acquisition.physics import kspace, receive
from handpipe.synthetic.acquisition.physics.anatomy import ImagedAnatomy
from handpipe.synthetic.acquisition.physics.effects import Effects
from handpipe.synthetic.acquisition.physics.fields import Field
from handpipe.synthetic.acquisition.physics.relaxation import TISSUES
from handpipe.synthetic.acquisition.physics.sequences import Sequence
from handpipe.synthetic.acquisition.physics.streams import Streams
from handpipe.synthetic.acquisition.physics.structures import detailed

PLANE = (0, 1)  # axes of readout and phase


def scan(
    anatomy: ImagedAnatomy, grid: VoxelGrid, sequence: Sequence, effects: Effects, seed: Numbers[int]
) -> NDArray[np.float32]:
    """Magnitude image of a subject.

    Parameters
    ----------
    anatomy : ImagedAnatomy
        Tissues on the grid, bones, direction of the palm.
    grid : VoxelGrid
        Voxels of the image. The first axis is the readout, the second one the phase direction, the third
        one is across the slices.
    sequence : Sequence
        Pulse sequence and field.
    effects : Effects
        Structures and artefacts, and how strong they are.
    seed : sequence of int
        Seed of all random numbers. Each effect has its own stream. The first number is the subject's: what
        moves with its bones is drawn from it alone.

    Returns
    -------
    array (nx, ny, nz) of float32
        Image in arbitrary units; its gain is random, too.
    """
    streams = Streams(seed)
    water, fat = signals(anatomy, grid, sequence, effects, streams)
    for image in (water, fat):
        image[...] = received(image, grid, effects, streams)
    k = fft.fft2(water, axes=PLANE, norm="ortho")
    peaks = kspace.of_fat(grid.shape[0], sequence, effects.size("chemical_shift"))
    k += fft.fft2(fat, axes=PLANE, norm="ortho") * peaks[:, None, None]
    del water, fat
    found = np.abs(fft.ifft2(sampled(k, grid, sequence, effects, streams), axes=PLANE, norm="ortho"))
    gain = streams.stream("gain").uniform(300.0, 1500.0) / sequence.reference
    return (found * gain).astype(np.float32)


def signals(
    anatomy: ImagedAnatomy, grid: VoxelGrid, sequence: Sequence, effects: Effects, streams: Streams
) -> tuple[Field, Field]:
    """Magnitudes (nx, ny, nz) of water and of fat (its peaks in phase) in each voxel, of an ideal scanner."""
    water, fat = np.zeros(grid.shape, np.float32), np.zeros(grid.shape, np.float32)
    for tissue, share in detailed(anatomy, grid, effects, streams):
        for image, level in zip((water, fat), sequence.levels(TISSUES[tissue]), strict=True):
            image += np.asarray(share, np.float32) * (np.float32(level) - image)
    return water, fat


def received(image: Field, grid: VoxelGrid, effects: Effects, streams: Streams) -> Field:
    """One species' signal after distortion, the coil and the slices."""
    if hertz := effects.size("distortion"):
        voxels = hertz / kspace.bandwidth(effects)
        image = receive.distorted(image, receive.field_shift(grid, voxels, streams.stream("distortion")))
    if far := effects.size("coil"):
        image = image * receive.coil_sensitivity(grid, far, streams.stream("coil"))
    deep = grid.shape[2]
    if width := effects.size("slice_profile"):
        image = image @ receive.profile(deep, width).T.astype(np.float32)
    if thickness := effects.size("slice_thickness"):
        image = image @ receive.slices(deep, thickness).T.astype(np.float32)
    return image


def sampled(
    k: kspace.Complex, grid: VoxelGrid, sequence: Sequence, effects: Effects, streams: Streams
) -> kspace.Complex:
    """k-space as it is sampled: folding, motion, noise, and zeros where nothing is acquired."""
    if share := effects.size("wrap"):
        k = kspace.folded(k, share)
    if amplitude := effects.size("ghosts"):
        k = kspace.moved(k, amplitude / grid.spacing, streams.stream("ghosts"))
    if noise := effects.size("noise"):
        k = kspace.noisy(k, noise * sequence.reference, streams.stream("noise"))
    return np.where(kspace.acquired(k.shape, effects), k, np.complex64(0))
