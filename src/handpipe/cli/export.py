"""What other programs open of a built subject: scenes, and the bones' labels with names and colours."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

from handpipe.core import InputError, paths
from handpipe.core.configuration import Dataset
from handpipe.imaging.volumes import read_label_table, read_volume, write_label_description, write_segments


def export(subject: str, dataset: Dataset, folder: Path) -> list[Path]:
    """Write what is built of a subject to a folder.

    Parameters
    ----------
    subject : str
        Its name.
    dataset : Dataset
        What its file says.
    folder : path
        Made if it is not there; files of the same names are replaced.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    InputError
        Where nothing is built yet.
    """
    scenes = sorted(paths.at(paths.SIMULATION, subject=subject).glob("*/*.glb"))
    labelled = [p for p in dataset.poses if paths.at(paths.LABELS, subject=subject, pose=p).is_file()]
    if not scenes and not labelled:
        results = paths.at(paths.SUBJECT, subject=subject)
        raise InputError(results, "files", "nothing is built yet", f"Run: handpipe build {subject}")
    folder.mkdir(parents=True, exist_ok=True)
    return [*_copies(scenes, folder), *_labels(subject, labelled, folder)]


def _copies(files: list[Path], folder: Path) -> Iterator[Path]:
    for file in files:
        yield Path(shutil.copy(file, folder / file.name))


def _labels(subject: str, poses: list[str], folder: Path) -> Iterator[Path]:
    """The bones of each pose for 3D Slicer and as NIfTI, and one label description for ITK-SNAP."""
    table: dict[str, int] = {}
    for pose in poses:
        labels = paths.at(paths.LABELS, subject=subject, pose=pose)
        volume = read_volume(labels)
        table |= read_label_table(labels)
        slicer = folder / f"{subject}-{pose}.seg.nrrd"
        write_segments(slicer, volume.values.astype("uint8"), volume.affine, table)
        yield slicer
        yield Path(shutil.copy(labels, folder / f"{subject}-{pose}.nii.gz"))
    if table:
        description = folder / f"{subject}-labels.txt"
        write_label_description(description, table)
        yield description
