"""Strokes of a small file, painted on the grid of an image as its file stores it."""

import json

import nibabel
import numpy as np
import pytest

from handpipe.core import InputError
from handpipe.imaging.segmentation import painted
from handpipe.imaging.volumes import read_labels, read_volume, write_labels


@pytest.fixture
def image(tmp_path):
    """An image whose first axis runs against RAS."""
    values = np.arange(10 * 8 * 6, dtype=np.float32).reshape(10, 8, 6)
    nibabel.save(nibabel.Nifti1Image(values, np.diag([-1.0, 1.0, 2.0, 1.0])), tmp_path / "image.nii.gz")
    return tmp_path / "image.nii.gz"


def drawn(folder, bones, outside=()):
    path = folder / "strokes.json"
    path.write_text(json.dumps({"bones": bones, "outside": list(outside)}))
    return path


def test_a_polyline_is_connected_and_lies_where_it_was_drawn(image, tmp_path) -> None:
    strokes = drawn(tmp_path, {"tibia": [[[1, 1, 1], [7, 4, 2], [7, 6, 5]]]}, [[[0, 0, 0]]])
    seeds, affine = painted(strokes, image, {"tibia": 3})
    assert seeds[1, 1, 1] == seeds[7, 4, 2] == seeds[7, 6, 5] == 3 and seeds[0, 0, 0] == 255
    found = np.argwhere(seeds == 3)
    steps = np.abs(np.diff(found[np.lexsort((found[:, 2], found[:, 1], found[:, 0]))], axis=0)).max(axis=1)
    assert steps.max() == 1
    write_labels(tmp_path / "seeds.nii.gz", seeds, affine)
    volume = read_volume(image)
    turned = read_labels(tmp_path / "seeds.nii.gz", volume)
    marked = volume.values[turned == 3]
    stored = np.asarray(nibabel.load(image).dataobj)[seeds == 3]
    assert sorted(marked.tolist()) == sorted(stored.tolist())


@pytest.mark.parametrize(
    ("bones", "problem"),
    [
        ({"tibia": [[[1, 1, 9]]]}, "out of"),
        ({"ulna": [[[1, 1, 1]]]}, "no bone"),
        ({"tibia": [[1, 1]]}, "read"),
    ],
)
def test_wrong_strokes_are_refused(image, tmp_path, bones, problem) -> None:
    with pytest.raises(InputError, match=problem):
        painted(drawn(tmp_path, bones), image, {"tibia": 3})
