"""Ten random draws of short strokes on the embedded hand: each bone right, or doubted in neutral by name.

A draw has one stroke of 3 mm in each bone's marrow and three around the bone. A bone whose marrow has a Dice
coefficient of less than `RIGHT` and that no check doubts is silent.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Metrics
from handpipe.core.configuration import Dataset, load_dataset
from handpipe.imaging.bone_surfaces import marrow_surface
from handpipe.imaging.segmentation import SegmentationSettings, claims, merge
from handpipe.imaging.volumes import Volume, read_labels, read_volume
from handpipe.imaging.volumes.volume import Labels, box
from handpipe.skeleton.registration import neutral_doubts
from handpipe.synthetic.acquisition.image import VoxelGrid
from handpipe.synthetic.acquisition.seeds import scribble_locally

log = logging.getLogger(__name__)

SUBJECT = "phantom-hand-preview"
DATASET = Path(__file__).parents[2] / "config" / "datasets" / f"{SUBJECT}.yaml"
SETTINGS = SegmentationSettings.model_validate({})
DRAWS = 10
STROKES, AROUND, LENGTH = 1, 3, 3.0  # in a bone, around it, mm
RIGHT = 0.93


@dataclass(frozen=True)
class Drawn:
    """Of one bone in one draw: the Dice coefficient of its marrow, and why it is doubted."""

    dice: float
    doubt: str


def measure(results: Path) -> Metrics:
    """Figures of all draws; `results` holds the built images and truth of the embedded hand."""
    dataset = load_dataset(DATASET)
    data = results / SUBJECT / "data"
    volume = read_volume(data / "volumes" / f"{dataset.neutral}.nii.gz")
    truth = {
        part: read_labels(data / "truth" / f"{dataset.neutral}.{part}.nii.gz", volume)
        for part in ("marrow", "bones")
    }
    found = {}
    for draw in range(DRAWS):
        seeds = drawn_seeds(volume, truth["marrow"], truth["bones"], draw)
        for name, bone in judged(dataset, volume, seeds, truth["marrow"]).items():
            log.info("draw %d: %s: Dice %.3f %s", draw, name, bone.dice, bone.doubt)
            found[draw, name] = bone
    return figures(list(found.values()))


def drawn_seeds(volume: Volume, marrow: Labels, whole: Labels, draw: int) -> Labels:
    """Seeds (nx, ny, nz) of one draw, from true labels of the marrow and of whole bones."""
    grid = VoxelGrid(volume.shape, volume.affine[:3, 3], float(volume.spacing[0]))
    rng = np.random.default_rng([draw, 77])
    return scribble_locally(marrow, whole, grid, rng, STROKES, AROUND, LENGTH)


def judged(dataset: Dataset, volume: Volume, seeds: Labels, marrow: Labels) -> dict[str, Drawn]:
    """The bones of a dataset from seeds, judged as the neutral pose is."""
    labels = {name: bone.label for name, bone in dataset.bones.items()}
    segmented, wrong = claims.segment(volume, seeds, labels, SETTINGS)
    _, merged = merge(volume, {labels[n]: b for n, b in segmented.items()}, seeds, SETTINGS)
    bones = {name: merged[labels[name]] for name in segmented}
    wrong |= claims.doubted(claims.appearances(volume, bones), {})
    marrows = {name: marrow_surface(volume, bone) for name, bone in bones.items() if name not in wrong}
    wrong |= neutral_doubts(marrows, dataset.joints)
    sizes = np.bincount(marrow.ravel(), minlength=256)
    found = {}
    for name, label in labels.items():
        both, own = 0, 0
        if name in bones:
            claimed = bones[name].probability > 0.5
            first, own = bones[name].offset, int(np.count_nonzero(claimed))
            both = int(np.count_nonzero(claimed & (marrow[box(first, first + claimed.shape)] == label)))
        found[name] = Drawn(float(2 * both / (own + sizes[label])), wrong.get(name, ""))
    return found


def figures(bones: list[Drawn]) -> Metrics:
    """Counts of bones by what is right and what is doubted; Dice of the bones that pass."""
    passed = [bone.dice for bone in bones if not bone.doubt]
    return {
        "seed_draws": (float(len(bones)), "1"),
        "seeds_silent": (float(sum(dice < RIGHT for dice in passed)), "1"),
        "seeds_doubted": (float(len(bones) - len(passed)), "1"),
        "seeds_false_alarms": (float(sum(bool(b.doubt) and b.dice >= RIGHT for b in bones)), "1"),
        "seed_dice_min": (min(passed, default=0.0), "1"),
        "seed_dice_mean": (float(np.mean(passed)) if passed else 0.0, "1"),
    }
