"""The phantom finger in neutral, imaged by physics under chosen effects and seeded as a person would."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from benchmarks.bones.subject import Scan
from handpipe.core.configuration import ImageEffect, Strength
from handpipe.imaging.volumes import Volume
from handpipe.synthetic.acquisition import image, seeds
from handpipe.synthetic.acquisition.physics import Effects, Sequence, kspace, scan
from handpipe.synthetic.acquisition.physics.sequences import Name, frequency
from handpipe.synthetic.acquisition.posed import PosedAnatomy, anatomy_of
from handpipe.synthetic.phantom import phantom_finger

MARGIN = 6.0  # mm of air
SEED = 1


@dataclass(frozen=True)
class Setting:
    """How the finger is imaged.

    sequence: None for the painted model; strengths: of effects by name; others: of all other effects;
    draw: number of the seeds' and the image's random draw.
    """

    sequence: Name | None = "spin_echo"
    field: float = 3.0
    strengths: tuple[tuple[ImageEffect, Strength], ...] = ()
    others: Strength = "none"
    spacing: float = 0.5
    draw: int = 0

    @property
    def effects(self) -> Effects:
        """The effects by name."""
        return Effects(dict(self.strengths), self.others)

    @property
    def displacement(self) -> float:
        """How far fat, and so marrow, is imaged from its place along the first axis, in mm."""
        if self.sequence is None or not self.effects.size("chemical_shift"):
            return 0.0
        return self.spacing * frequency(self.field) / kspace.bandwidth(self.effects)


@cache
def posed() -> PosedAnatomy:
    """The finger in neutral."""
    return phantom_finger.finger().posed(phantom_finger.posture("neutral", SEED))


@cache
def grid(spacing: float) -> image.VoxelGrid:
    """The voxels around the skin."""
    return image.VoxelGrid.around(posed().skin[0], MARGIN, spacing)


@cache
def drawn(spacing: float, draw: int) -> seeds.Labels:
    """Strokes in each bone's marrow and around it."""
    finger, voxels = posed(), grid(spacing)
    labels = {name: number for number, name in enumerate(finger.bones, 1)}
    whole = image.label_volume({labels[n]: s for n, s in finger.bones.items()}, voxels)
    marrow = image.label_volume({labels[n]: s for n, s in finger.marrow.items()}, voxels)
    return seeds.scribble(marrow, whole, voxels, np.random.default_rng([SEED, draw, 2]))


def finger_scan(setting: Setting) -> Scan:
    """The finger's volume under a setting, with seeds and truth."""
    finger, voxels = posed(), grid(setting.spacing)
    anatomy = anatomy_of(finger, voxels)
    values: NDArray
    if setting.sequence is None:
        clean = image.paint_layers(anatomy.layers, image.INTENSITIES, voxels)
        values = image.acquire(clean, voxels, np.random.default_rng([SEED, setting.draw, 3]))[0]
    else:
        sequence = Sequence.named(setting.sequence, setting.field)
        values = scan(anatomy, voxels, sequence, setting.effects, [SEED, setting.draw, 6])
    volume = Volume(np.ascontiguousarray(values, dtype=np.float32), voxels.affine)
    labels = {name: number for number, name in enumerate(finger.bones, 1)}
    return Scan(volume, drawn(setting.spacing, setting.draw).copy(), finger, labels)
