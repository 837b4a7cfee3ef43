"""Volumes, seeds, label maps and skin scans of each pose in a folder, told by the names of files."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from handpipe.core import InputError
from handpipe.imaging.volumes import holds_background
from handpipe.mesh.files import SURFACE_SUFFIXES

SEGMENTATION = ".seg.nrrd"
VOLUMES = (".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd")
SEEDS = re.compile(r"[ _.-]*(seeds?|strokes?)$", re.IGNORECASE)
LABELS = re.compile(r"[ _.-]*(labels?|labelmap|seg|segmentation)$", re.IGNORECASE)
OTHER_WORDS = re.compile(r"[ _.-]*(scan|skin|mri|mr|image|volume)$", re.IGNORECASE)
TEMPLATE = "template"  # folder of the template's files beside the scans


def find_poses(folder: Path) -> dict[str, dict[str, Path]]:
    """Volumes, seeds, label maps and scans of each pose, told by the names of files.

    A segmentation is seeds where its name says so or where it has the background, else a label map.

    Parameters
    ----------
    folder : path
        Searched with its sub-folders.

    Returns
    -------
    dict
        By pose and field (`volume`, `seeds`, `labels`, `scan`), paths relative to the folder. A pose may lack
        any.

    Raises
    ------
    InputError
        Where there is no such folder, or there are two files for one field of a pose.
    """
    if not folder.is_dir():
        raise InputError(folder, "folder", "does not exist", "Name the folder of the scans")
    poses: dict[str, dict[str, Path]] = {}
    for path in sorted(_candidates(folder)):
        kind, pose = _kind(path, folder)
        found = poses.setdefault(pose, {})
        if kind in found:
            problem = f"{found[kind]} and {path} are both the {kind} of {pose}"
            raise InputError(folder, "files", problem, "Rename or move one of them")
        found[kind] = path
    return poses


def _candidates(folder: Path) -> Iterator[Path]:
    """Files of volumes, seeds and scans, and folders of DICOM images, relative to the folder."""
    for path in folder.rglob("*"):
        relative = path.relative_to(folder)
        if TEMPLATE in relative.parts or any(part.startswith(".") for part in relative.parts):
            continue
        series = path.is_dir() and any(map(_is_dicom, path.iterdir()))
        if series or (path.is_file() and path.name.lower().endswith((*VOLUMES, *SURFACE_SUFFIXES))):
            yield relative


def _is_dicom(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(132)[128:] == b"DICM"


def _kind(path: Path, folder: Path) -> tuple[str, str]:
    """The field that a file is for, and its pose: its name without what tells its kind."""
    name = path.name
    suffix = next((s for s in (SEGMENTATION, *VOLUMES, *SURFACE_SUFFIXES) if name.lower().endswith(s)), "")
    stem = name[: len(name) - len(suffix)]
    kind = "scan" if suffix in SURFACE_SUFFIXES else "volume"
    if kind == "volume" and (SEEDS.search(stem) or SEEDS.search(path.parent.name)):
        kind = "seeds"
    elif kind == "volume" and (
        suffix == SEGMENTATION or LABELS.search(stem) or LABELS.search(path.parent.name)
    ):
        kind = "seeds" if holds_background(folder / path) else "labels"
    stem = OTHER_WORDS.sub("", LABELS.sub("", SEEDS.sub("", stem))) or path.parent.name or folder.name
    pose = re.sub(r"[^A-Za-z0-9]+", "_", stem).strip("_")
    return kind, pose if pose[:1].isalpha() else f"pose_{pose}"
