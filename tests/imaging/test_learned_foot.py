"""A real foot at three echo times: bones learned from strokes on one echo agree in all, or are named."""

from __future__ import annotations

import json
from itertools import combinations

import numpy as np
import pytest
from benchmarks.scans.foot import DRAWN_ON, ECHOES, STROKES
from benchmarks.scans.strokes import rasterised, write_strokes

from handpipe.imaging.bone_surfaces import outline_surface
from handpipe.imaging.learned import learned_doubts, segment_learned
from handpipe.imaging.segmentation import BACKGROUND
from handpipe.imaging.volumes import read_labels, read_volume

PATHS = sorted(ECHOES.glob("*.nii.gz"))
FEW = ECHOES.parent / "strokes.json"  # of five bones, drawn in two slices
MIDFOOT = ["talus", "navicular", "cuboid", "medial_cuneiform", "intermediate_cuneiform", "lateral_cuneiform"]
LOWER, UPPER = np.array([26, 32, 42]), np.array([78, 118, 108])  # voxels of the stored file, turned to RAS
AGREE = 0.93  # Dice coefficient of one bone in two echoes, whose difference is noise and contrast alone
FEW_AGREE = 0.9

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not PATHS, reason="the shared real MRI is not beside the checkout"),
]


def dice(a, b):
    return 2 * (a & b).sum() / max(a.sum() + b.sum(), 1)


def claimed(volume, bone):
    out = np.zeros(volume.shape, bool)
    out[bone.slices] = bone.probability > 0.5
    return out


def test_strokes_are_in_the_slices_that_they_name(tmp_path) -> None:
    drawn = {
        "bones": {"a": {"k2": [[[1, 1], [4, 1]]], "i3": [[[5, 6], [5, 6]]]}},
        "outside": {"j0": [[[0, 7], [2, 7]]]},
    }
    seeds, labels = rasterised(drawn, (8, 8, 8))
    assert labels == {"a": 1}
    assert set(map(tuple, np.argwhere(seeds == 1))) == {(1, 1, 2), (2, 1, 2), (3, 1, 2), (4, 1, 2), (3, 6, 5)}
    assert set(map(tuple, np.argwhere(seeds == BACKGROUND))) == {(0, 0, 7), (1, 0, 7), (2, 0, 7)}


def test_a_foot_has_fourteen_bones() -> None:
    assert len(json.loads(STROKES.read_text())["bones"]) == 14


def echoes_of(strokes, folder):
    """Each echo with the strokes, and the labels."""
    labels = write_strokes(strokes, PATHS[DRAWN_ON], folder / "seeds.nii.gz")
    volumes = [read_volume(path) for path in PATHS]
    return [(volume, read_labels(folder / "seeds.nii.gz", volume)) for volume in volumes], labels


def test_bones_of_the_midfoot_agree_in_three_echoes(tmp_path) -> None:
    """The contrast of fat against water turns over between the echoes; the strokes are of one of them."""
    echoes, labels = echoes_of(STROKES, tmp_path)
    masks = []
    for volume, seeds in echoes:
        crop = volume.crop(LOWER, UPPER)
        marks = seeds[tuple(slice(a, b) for a, b in zip(LOWER, UPPER, strict=True))]
        bones, wrong = segment_learned([crop], marks, labels)
        doubts = wrong | learned_doubts(bones)
        assert not doubts.keys() & set(MIDFOOT)
        found = {name: claimed(crop, bones[name]) for name in MIDFOOT}
        assert (sum(m.astype(int) for m in found.values()) <= 1).all()
        assert all(outline_surface(crop, bones[name]).is_closed() for name in MIDFOOT)
        masks.append(found)
    for name in MIDFOOT:
        for a, b in combinations(masks, 2):
            assert dice(a[name], b[name]) > AGREE, name


def test_few_strokes_agree_or_are_doubted(tmp_path) -> None:
    """Of strokes in two slices, no bone passes that another echo does not confirm."""
    drawn = json.loads(FEW.read_text())
    planes = {"bones": {}, "outside": {}}
    for name, lines in drawn["bones"].items():
        planes["bones"][name] = {
            f"k{k}": [[p[:2] for p in line] for line in lines if line[0][2] == k] for k in (46, 56)
        }
    for i, j, k in drawn["outside"]:
        planes["outside"].setdefault(f"k{k}", []).append([[i - 1, j], [i + 1, j]])
    (tmp_path / "few.json").write_text(json.dumps(planes))
    echoes, labels = echoes_of(tmp_path / "few.json", tmp_path)
    found, wrong = [], []
    for volume, seeds in echoes:
        bones, missing = segment_learned([volume], seeds, labels)
        found.append({name: claimed(volume, bone) for name, bone in bones.items()})
        wrong.append(missing | learned_doubts(bones))
    for name in labels:
        for a, b in combinations(range(3), 2):
            if name in wrong[a] or name in wrong[b]:
                continue
            assert dice(found[a][name], found[b][name]) > FEW_AGREE, name
