"""The phantom finger's files for the chain: images of three poses under effects, strokes, templates."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.images.subject import MARGIN, SEED, Setting
from handpipe.core.configuration import Dataset, load_dataset
from handpipe.synthetic.acquisition import image, seeds
from handpipe.synthetic.acquisition.physics import ImagedAnatomy, Sequence, scan
from handpipe.synthetic.acquisition.posed import PALM, PosedAnatomy, layers
from handpipe.synthetic.phantom import phantom_finger

DATASET = Path(__file__).parents[3] / "config" / "datasets" / "phantom-finger.yaml"
CARRIERS = ("metacarpal2", "proximal2")  # bones of the finger's muscles
NEUTRAL, EXAMPLES = "neutral", ("curl", "spread")  # they bend every joint, and turn MP2 to either side


@cache
def posed(pose: str) -> PosedAnatomy:
    """All organs in a pose."""
    return phantom_finger.finger().posed(phantom_finger.posture(pose, SEED))


def dataset_in(folder: Path) -> Dataset:
    """The finger's dataset with three poses, without ligaments and truth, its files in a folder.

    Only bones that muscles lie on have a template, which carries those of the muscles.
    """
    whole = load_dataset(DATASET)
    bones = {
        n: b if n in CARRIERS else b.model_copy(update={"template": None}) for n, b in whole.bones.items()
    }
    poses = {name: whole.poses[name] for name in (NEUTRAL, *EXAMPLES)}
    return changed(whole, root=folder, poses=poses, bones=bones, ligaments={}, truth=None)


def changed(dataset: Dataset, **parts: Any) -> Dataset:
    """A dataset with other parts; not a copy, which keeps what was derived from the old ones."""
    known = {name: getattr(dataset, name) for name in Dataset.model_fields}
    return Dataset.model_validate(known | parts)


def write_templates(dataset: Dataset) -> None:
    """Templates, attachments and tendon curves, which no image changes."""
    phantom_finger.generate_templates(dataset)


def write_images(dataset: Dataset, setting: Setting) -> None:
    """Volume and strokes of every pose under a setting."""
    for pose, files in dataset.poses.items():
        drawn = _imaged(dataset.labels, pose, setting.spacing)
        anatomy = ImagedAnatomy(drawn.layers, drawn.bones, drawn.palm)
        sequence = Sequence.named(setting.sequence or "spin_echo", setting.field)
        seed = [SEED, setting.draw, zlib.crc32(pose.encode()), 6]
        values = scan(anatomy, drawn.grid, sequence, setting.effects, seed)
        image.write_volume(dataset.path(files.volume), values, drawn.grid)
        assert files.seeds is not None
        image.write_volume(dataset.path(files.seeds), drawn.strokes, drawn.grid)


@dataclass(frozen=True, eq=False)
class _Drawn:
    """What all images of a pose in one voxel size share."""

    grid: image.VoxelGrid
    layers: list[tuple[str, np.ndarray]]
    bones: list[image.Surface]
    palm: np.ndarray
    strokes: seeds.Labels


_KEPT: dict[tuple[str, float], _Drawn] = {}


def _imaged(labels: Mapping[str, int], pose: str, spacing: float) -> _Drawn:
    """Shares of tissues and strokes of a pose, kept until another voxel size is asked for."""
    if (pose, spacing) not in _KEPT:
        for key in [key for key in _KEPT if key[1] != spacing]:
            del _KEPT[key]
        _KEPT[pose, spacing] = _draw(labels, pose, spacing)
    return _KEPT[pose, spacing]


def _draw(labels: Mapping[str, int], pose: str, spacing: float) -> _Drawn:
    organs = posed(pose)
    grid = image.VoxelGrid.around(organs.skin[0], MARGIN, spacing)
    shares = [(tissue, share.astype(np.float32)) for tissue, share in layers(organs, grid)]
    whole = image.label_volume({labels[n]: s for n, s in organs.bones.items()}, grid)
    marrow = image.label_volume({labels[n]: s for n, s in organs.marrow.items()}, grid)
    rng = np.random.default_rng([SEED, zlib.crc32(pose.encode()), 2])
    strokes = seeds.scribble_locally(marrow, whole, grid, rng)
    root = organs.transforms[next(iter(organs.transforms))]
    return _Drawn(grid, shares, [*organs.bones.values()], root.rotation @ PALM, strokes)
