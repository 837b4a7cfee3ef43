"""What other programs open of a built subject: scenes, the bones' labels with names and colours, tables."""

from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from handpipe.cli.own_files import written_anew
from handpipe.core import LAYERS, InputError, paths, write_text
from handpipe.core.configuration import Dataset
from handpipe.hand import SimulatedFrame, StoredFrames, load_layers
from handpipe.hand.exports import Mechanical, write_deck, write_usd
from handpipe.imaging.volumes import read_label_table, read_volume, write_label_description, write_segments
from handpipe.skeleton.rig import Rig


def export(subject: str, dataset: Dataset, folder: Path, usd: bool = False) -> list[Path]:
    """Write what is built of a subject to a folder.

    Parameters
    ----------
    subject : str
        Its name.
    dataset : Dataset
        What its file says.
    folder : path
        Made if it is not there. What an earlier export of the subject left there is replaced or removed.
    usd : bool
        Whether to write each scene as USD, too.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    InputError
        Where nothing is built yet, or a file of another subject's export would be replaced.
    """
    scenes = sorted(paths.at(paths.SIMULATION, subject=subject).glob("*/*.glb"))
    labelled = [p for p in dataset.poses if paths.at(paths.LABELS, subject=subject, pose=p).is_file()]
    tables = sorted(paths.at(paths.TABLE, subject=subject, stage="*").parent.glob("*.json"))
    metrics = sorted(paths.at(paths.METRICS, subject=subject, stage="*").parent.glob("*.json"))
    if not scenes and not labelled and not tables:
        results = paths.at(paths.SUBJECT, subject=subject)
        raise InputError(results, "files", "nothing is built yet", f"Run: handpipe build {subject}")
    with written_anew(folder, f"handpipe export {subject}") as made:
        written = [
            *_copies(scenes, made),
            *_models(subject, made),
            *(_scenes_as_usd(subject, made) if usd else ()),
            *_labels(subject, labelled, made),
            *_tables(subject, tables, made),
            *_metrics(subject, metrics, made),
        ]
    return [folder / path.relative_to(made) for path in written]


def deck(subject: str, dataset: Dataset, scene: str, frame: str, body: str, path: Path) -> None:
    """Write one body of tets of a simulated frame as an input deck of Abaqus.

    Parameters
    ----------
    subject : str
        Its name.
    dataset : Dataset
        What its file says.
    scene, frame, body : str
        Names of the scene, of one of its frames, and of a muscle, a ligament or "fat".
    path : path
        File to be written.

    Raises
    ------
    InputError
        Where the scene has no such frame or body.
    """
    folder = paths.at(paths.SIMULATION, subject=subject) / scene
    chunks = _chunks(folder)
    if not chunks:
        raise InputError(folder, "frames", "nothing is simulated yet", f"Run: handpipe build {subject}")
    found, layers = _frame(chunks, folder, frame)
    owners = {
        name.removesuffix("_mesh"): layer
        for layer, bodies in layers.items()
        for name in bodies
        if name.endswith("_mesh")
    }
    if body not in owners:
        raise InputError(folder, body, "is no body of tets", f"Name one of {', '.join(owners)}")
    name = f"{body}_mesh"
    elastic = _load(subject, dataset, owners[body]).elastic_bodies(found.bones)[name]
    title = f"{body} of {subject}, frame {frame} of scene {scene}"
    write_deck(path, elastic, layers[owners[body]][name].vertices, title)


def _load(subject: str, dataset: Dataset, layer: str) -> Mechanical:
    rig = Rig.load(paths.at(paths.RIG, subject=subject))
    files = [paths.at(paths.SUBJECT, subject=subject) / file for file in LAYERS[layer].files(dataset)]
    [loaded] = load_layers([layer], dataset, files, rig.surfaces)
    assert isinstance(loaded, Mechanical), "the layers that have tets tell their potentials"
    return loaded


def _chunks(scene: Path) -> list[Path]:
    """The files of frames in a scene's folder, in order."""
    return sorted(scene.glob("frames-*.h5"), key=lambda p: int(p.stem.removeprefix("frames-")))


def _frame(chunks: list[Path], folder: Path, name: str) -> SimulatedFrame:
    """A frame by its name; `InputError`, which names the scene's folder, where there is none."""
    frames = StoredFrames(chunks)
    if name not in frames.names:
        raise InputError(folder, name, "is no frame", f"Name one of {', '.join(frames.names)}")
    return frames[frames.names.index(name)]


def _scenes_as_usd(subject: str, folder: Path) -> Iterator[Path]:
    for scene in sorted(paths.at(paths.SIMULATION, subject=subject).glob("*/")):
        if chunks := _chunks(scene):
            file = folder / f"{scene.name}.usdc"
            write_usd(file, StoredFrames(chunks))
            yield file


def _copies(files: list[Path], folder: Path) -> Iterator[Path]:
    for file in files:
        yield Path(shutil.copy(file, folder / file.name))


def _models(subject: str, folder: Path) -> Iterator[Path]:
    """Each scene's models of the skeleton with their meshes, where the scene asks for them."""
    scenes, name = paths.at(paths.SIMULATION, subject=subject), Path(paths.SCENE_SKELETON).name
    for model in sorted(scenes.glob(f"*/{name}")):
        copied = folder / f"{model.parent.name}-{model.name}"
        yield Path(shutil.copytree(model, copied, dirs_exist_ok=True))


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
