"""Snakemake's cache between workflows: what one folder has built, another one takes."""

from pathlib import Path

import nibabel
import numpy as np
import pytest

from handpipe.core import artifacts

from .running import run, working_copy
from .small_subject import POSES, write_subject

CACHED = ("segmentation/{pose}/bones.h5", "registration/{pose}.h5")


def build(folder: Path, cache: Path) -> None:
    arguments = ("-j2", "registration", "--config", "subjects=[small]", "--cache")
    process = run(folder, *arguments, environment={"SNAKEMAKE_OUTPUT_CACHE": str(cache)})
    assert process.returncode == 0, process.stdout


def made_here(folder: Path) -> set[str]:
    """Jobs of cached rules that ran in a folder. A file from the cache has an empty log."""
    logs = folder / "results" / "small" / "logs"
    rules = ("segment_pose", "register_bones")
    found = [path for rule in rules for path in (logs / rule).glob("*.log")]
    return {f"{path.parent.name}/{path.stem}" for path in found if path.stat().st_size}


def hashes(folder: Path) -> dict[str, str]:
    files = [pattern.format(pose=pose) for pattern in CACHED for pose in POSES]
    return {file: artifacts.identity(folder / "results" / "small" / file) for file in files}


@pytest.mark.slow
def test_what_another_folder_built_is_taken_until_an_image_changes(tmp_path: Path) -> None:
    """Both poses of the small subject have one image: a key without the pose's name would mix them up."""
    cache, first, second = (tmp_path / name for name in ("cache", "first", "second"))
    cache.mkdir()
    for folder in (first, second):
        working_copy(folder)
        write_subject(folder)
        build(folder, cache)
    assert made_here(first) == {"segment_pose/flat", "segment_pose/bent", "register_bones/bent"}
    assert made_here(second) == set()
    assert hashes(second) == hashes(first)

    path = second / "small" / "bent.nii.gz"
    image = nibabel.load(path)
    moved = np.roll(np.asarray(image.dataobj), 1, axis=1)
    nibabel.save(nibabel.Nifti1Image(moved, image.affine), path)
    build(second, cache)
    assert made_here(second) == {"segment_pose/bent", "register_bones/bent"}
    changed = {file for file, known in hashes(first).items() if hashes(second)[file] != known}
    assert changed == {"segmentation/bent/bones.h5", "registration/bent.h5"}
