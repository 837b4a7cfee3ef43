"""Marks far from the strokes: a shell that leaks, in fat whose brightness changes along the volume."""

from __future__ import annotations

import numpy as np
import pytest

from handpipe.imaging.segmentation import segmentation
from handpipe.imaging.segmentation.random_walker import INSIDE
from handpipe.imaging.segmentation.sure_marks import SureMarks, sure_marks
from handpipe.imaging.volumes.volume import Volume

SPACING, RADIUS = 0.5, 4.0  # mm
SHAPE = (280, 40, 40)  # 140 mm long: more than any bone


def leaking_ball(lobules: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Intensities, strokes (1 marrow, 255 fat) and the marrow; fat is 1.0 near it, 1.7 far off.

    lobules: by how much parts of the fat are brighter than the rest.
    """
    x, y, z = np.indices(SHAPE) * SPACING
    away = np.sqrt((x - 12.0) ** 2 + (y - 10.0) ** 2 + (z - 10.0) ** 2)
    values = 1.0 + 0.7 * np.clip((x - 20.0) / 100.0, 0.0, 1.0)
    waves = np.cos(np.pi * x / 3.0) * np.cos(np.pi * y / 3.0) * np.cos(np.pi * z / 3.0)
    values += lobules * (np.abs(waves) > 0.5) * (x > 18.0)
    values[away < RADIUS + 1.0] = 0.1
    hole = (away < RADIUS + 1.0) & (x > 12.0) & (np.hypot(y - 10.0, z - 10.0) < 0.8)
    values[hole] = 0.65  # what is left of a cortex that fat's chemical shift covers
    marrow = away < RADIUS
    values[marrow] = 1.0
    strokes = np.zeros(SHAPE, np.uint8)
    strokes[22:27, 20, 20] = 1
    strokes[40:46, 8, 20] = strokes[10:40, 35, 20] = strokes[10:40, 20, 3] = 255
    return values.astype(np.float32), strokes, marrow


def test_a_bone_has_no_marks_behind_the_tissue_of_others() -> None:
    values, strokes, marrow = leaking_ball()
    found = sure_marks(values, strokes == 1, strokes == 255, values > 0.3)
    inside = found.marks == INSIDE
    assert not inside[~marrow].any() and inside[marrow].mean() > 0.8
    assert not found.growing[100:].any()


def test_marrow_behind_a_shell_that_leaks_is_found_near_its_strokes(monkeypatch: pytest.MonkeyPatch) -> None:
    values, strokes, marrow = leaking_ball(lobules=0.45)
    looked: list[tuple[int, ...]] = []

    def recorded(values: np.ndarray, *masks: np.ndarray) -> SureMarks:
        looked.append(values.shape)
        return sure_marks(values, *masks)

    monkeypatch.setattr(segmentation, "sure_marks", recorded)
    volume = Volume(values, np.diag([SPACING, SPACING, SPACING, 1.0]))
    bone = segmentation.segment_bone(volume, strokes, 1, segmentation.SegmentationSettings())
    claimed = np.zeros(SHAPE, bool)
    claimed[bone.slices] = bone.probability > 0.5
    assert 2 * (claimed & marrow).sum() / (claimed.sum() + marrow.sum()) > 0.97
    assert max(shape[0] for shape in looked) * SPACING < 2.5 + 2 * 30.0  # the strokes, 30 mm on both sides
