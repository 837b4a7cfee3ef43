"""What other programs open of a built subject: scenes, the bones' labels with names and colours, tables."""

from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from handpipe.core import InputError, paths, write_text
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
    tables = sorted(paths.at(paths.TABLE, subject=subject, stage="*").parent.glob("*.json"))
    metrics = sorted(paths.at(paths.METRICS, subject=subject, stage="*").parent.glob("*.json"))
    if not scenes and not labelled and not tables:
        results = paths.at(paths.SUBJECT, subject=subject)
        raise InputError(results, "files", "nothing is built yet", f"Run: handpipe build {subject}")
    folder.mkdir(parents=True, exist_ok=True)
    return [
        *_copies(scenes, folder),
        *_labels(subject, labelled, folder),
        *_tables(subject, tables, folder),
        *_metrics(subject, metrics, folder),
    ]


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


def _tables(subject: str, files: list[Path], folder: Path) -> Iterator[Path]:
    """Each table as CSV: a column for each key of any row, in the order in which keys appear."""
    for file in files:
        rows = json.loads(file.read_text(encoding="utf-8"))
        yield _write_csv(folder / f"{subject}-{file.stem}.csv", rows)


def _metrics(subject: str, files: list[Path], folder: Path) -> Iterator[Path]:
    """The figures of all stages as one CSV."""
    rows = [
        {"stage": file.stem, "name": name, **figure}
        for file in files
        for name, figure in json.loads(file.read_text(encoding="utf-8")).items()
    ]
    if rows:
        yield _write_csv(folder / f"{subject}-metrics.csv", rows)


def _write_csv(path: Path, rows: list[dict[str, Any]]) -> Path:
    text = io.StringIO()
    writer = csv.DictWriter(
        text, list(dict.fromkeys(key for row in rows for key in row)), lineterminator="\n"
    )
    writer.writeheader()
    writer.writerows(rows)
    write_text(path, text.getvalue())
    return path
