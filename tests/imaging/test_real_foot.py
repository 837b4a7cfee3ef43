"""A real foot at three echo times: no bone passes that the echoes do not agree on.

Its marrow is darker than muscle, and no dark shell ends it: what the pipeline promises of generated hands
does not hold there. Refused or doubted, each bone by name, is right where strokes do not suffice.
"""

import json
from pathlib import Path

import nibabel
import numpy as np
import pytest

from handpipe.imaging.segmentation import claims
from handpipe.imaging.segmentation.merging import merge
from handpipe.imaging.segmentation.segmentation import (
    BACKGROUND,
    BoneProbability,
    SegmentationSettings,
)
from handpipe.imaging.volumes.volume import Labels, Volume, read_labels, read_volume

DATA = Path(__file__).parents[3] / "shared" / "data" / "real_mri"
ECHOES = sorted((DATA / "foot_dixon").glob("*.nii.gz"))
SETTINGS = SegmentationSettings()
AGREE = 0.9  # Dice coefficient of one bone in two echoes, whose difference is noise and contrast alone

pytestmark = pytest.mark.skipif(not ECHOES, reason="the shared real MRI is not beside the checkout")


def strokes_of(path: Path, folder: Path) -> tuple[Path, dict[str, int]]:
    """A file of the strokes on the grid of an image as it is stored, and the bones' labels."""
    drawn = json.loads((DATA / "strokes.json").read_text())
    image = nibabel.load(path)
    labels = {name: number for number, name in enumerate(drawn["bones"], 1)}
    seeds = np.zeros(image.shape, np.uint8)
    for i, j, k in drawn["outside"]:
        seeds[i - 1 : i + 2, j - 1 : j + 2, k] = BACKGROUND
    for name, lines in drawn["bones"].items():
        for line in map(np.asarray, lines):
            share = np.linspace(0, len(line) - 1, 200)
            points = [np.interp(share, np.arange(len(line)), line[:, axis]) for axis in range(3)]
            seeds[tuple(np.round(points).astype(int))] = labels[name]
    nibabel.save(nibabel.Nifti1Image(seeds, image.affine), folder / f"seeds-{path.name}")
    return folder / f"seeds-{path.name}", labels


def claimed(volume: Volume, bone: BoneProbability) -> np.ndarray:
    out = np.zeros(volume.shape, bool)
    out[bone.slices] = bone.probability > 0.5
    return out


def bones_of(
    volume: Volume, seeds: Labels, labels: dict[str, int]
) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """What each bone claims, and what is wrong with bones."""
    found, wrong = claims.segment(volume, seeds, labels, SETTINGS)
    _, merged = merge(volume, {labels[n]: b for n, b in found.items()}, seeds, SETTINGS)
    bones = {name: merged[labels[name]] for name in found}
    wrong |= claims.doubted(claims.appearances(volume, bones), {})
    return {name: claimed(volume, bone) for name, bone in bones.items()}, wrong


def test_bones_of_a_real_foot_agree_between_echoes_or_are_named(tmp_path: Path) -> None:
    found, wrong = [], []
    for path in ECHOES:
        volume = read_volume(path)
        file, labels = strokes_of(path, tmp_path)
        bones, doubts = bones_of(volume, read_labels(file, volume), labels)
        assert set(bones) | set(doubts) == set(labels)
        assert all("draw" in text for text in doubts.values()), "each doubt says what to draw"
        found.append(bones)
        wrong.append(doubts)
    for echo, bones in enumerate(found):
        for name in bones.keys() - wrong[echo].keys():
            for others in found:
                other = others.get(name, np.zeros_like(bones[name]))
                dice = 2 * (bones[name] & other).sum() / (bones[name].sum() + other.sum())
                assert dice > AGREE, f"{name} passes in echo {echo + 1}, and another one disagrees"
