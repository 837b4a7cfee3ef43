"""A dataset file for a folder of scans: what is found there, and the template hand for all else."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import yaml

from handpipe.anatomy import shipped
from handpipe.cli.first_scene import scene_files, write_first_scene
from handpipe.core import InputError, write_text
from handpipe.core.configuration import load_dataset
from handpipe.imaging.volumes import holds_background

SEGMENTATION = ".seg.nrrd"
VOLUMES = (".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd")
SCANS = (".ply", ".obj", ".stl")
SEEDS = re.compile(r"[ _.-]*(seeds?|strokes?)$", re.IGNORECASE)
LABELS = re.compile(r"[ _.-]*(labels?|labelmap|seg|segmentation)$", re.IGNORECASE)
OTHER_WORDS = re.compile(r"[ _.-]*(scan|skin|mri|mr|image|volume)$", re.IGNORECASE)
NEUTRAL = ("neutral", "rest", "relaxed", "flat")  # names of a pose that is taken for neutral, best first
TEMPLATE = "template"  # folder of the template's files beside the scans
HEADER = """\
# Written by `handpipe init`; config/README.md explains each field. Edit it freely: nothing overwrites it.
# Bones, joints and organs are those of the template hand; their files are in {template}.
"""


def init(
    name: str,
    folder: Path,
    side: Literal["right", "left"],
    neutral: str | None = None,
    heldout: tuple[str, ...] = (),
    only: tuple[str, ...] = (),
) -> tuple[Path, list[str]]:
    """Write config/datasets/NAME.yaml for a folder of scans, and the template's files into the folder.

    A first scene of that name is written to config/scenes.

    Parameters
    ----------
    name : str
        The subject's.
    folder : path
        With the volumes, seeds and skin scans of all poses; a DICOM series in a folder of its own.
    side : "right" or "left"
        Which hand it is.
    neutral : str or None
        The neutral pose, where its name does not tell.
    heldout : tuple of str
        Poses that only test the result.
    only : tuple of str
        Fingers or bones that the scans show; all where there are none.

    Returns
    -------
    path : Path
        The dataset file.
    notes : list of str
        What was found, and what is to be done before the build.

    Raises
    ------
    InputError
        Where there is such a dataset, no volume, or no pose that may be neutral.
    """
    path = Path(f"config/datasets/{name}.yaml")
    bones = shipped.bones_of_part(shipped.fields_of(side), only) if only else None
    for file in (path, *scene_files(name)):
        if file.exists():
            raise InputError(file, "file", "exists already", "Edit it, or choose another name")
    found = find_poses(folder)
    poses = {pose: files for pose, files in found.items() if "volume" in files}
    if not poses:
        problem = f"holds no volume ({', '.join(VOLUMES)}, or a folder of DICOM images)"
        raise InputError(folder, "files", problem, "Name the folder of the scans")
    rest = _neutral(folder, poses, neutral)
    for pose in heldout:
        if pose not in poses:
            raise InputError(folder, "heldout", f"has no pose {pose}", f"The poses are {', '.join(poses)}")
    if "labels" not in poses[rest]:
        poses[rest].setdefault("seeds", Path(f"{rest}-seeds.seg.nrrd"))
    content: dict[str, Any] = {
        "name": name,
        "root": str(folder),
        "units": "mm",
        "hand": side,
        "poses": {
            pose: {"role": _role(pose, rest, heldout)} | {field: str(file) for field, file in files.items()}
            for pose, files in sorted(poses.items(), key=lambda item: (item[0] != rest, item[0]))
        },
    }
    if "scan" not in poses[rest]:
        content["skin_from_volume"] = True
    content |= _below(TEMPLATE, shipped.fields_of(side, bones=bones)) | {"drawn_in": "template"}
    text = HEADER.format(template=folder / TEMPLATE)
    write_text(path, text + yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=110))
    scene: list[Path] = []
    try:
        scene += write_first_scene(name, load_dataset(path))
        shipped.install(folder / TEMPLATE, side, bones=bones)
    except BaseException:
        for file in (path, *scene):  # nothing is half-written
            file.unlink()
        raise
    unused = [file for pose, files in found.items() if pose not in poses for file in files.values()]
    return path, [*_notes(folder, rest, poses, unused)]


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
        if series or (path.is_file() and path.name.lower().endswith((*VOLUMES, *SCANS))):
            yield relative


def _is_dicom(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(132)[128:] == b"DICM"


def _kind(path: Path, folder: Path) -> tuple[str, str]:
    """The field that a file is for, and its pose: its name without what tells its kind."""
    name = path.name
    suffix = next((s for s in (SEGMENTATION, *VOLUMES, *SCANS) if name.lower().endswith(s)), "")
    stem = name[: len(name) - len(suffix)]
    kind = "scan" if suffix in SCANS else "volume"
    if kind == "volume" and (SEEDS.search(stem) or SEEDS.search(path.parent.name)):
        kind = "seeds"
    elif kind == "volume" and (
        suffix == SEGMENTATION or LABELS.search(stem) or LABELS.search(path.parent.name)
    ):
        kind = "seeds" if holds_background(folder / path) else "labels"
    stem = OTHER_WORDS.sub("", LABELS.sub("", SEEDS.sub("", stem))) or path.parent.name or folder.name
    pose = re.sub(r"[^A-Za-z0-9]+", "_", stem).strip("_")
    return kind, pose if pose[:1].isalpha() else f"pose_{pose}"


def _neutral(folder: Path, poses: Mapping[str, object], given: str | None) -> str:
    by_name = {pose.casefold(): pose for pose in poses}
    if given is not None:
        if given not in poses:
            raise InputError(folder, "neutral", f"has no pose {given}", f"The poses are {', '.join(poses)}")
        return given
    if len(poses) == 1:
        return next(iter(poses))
    for name in NEUTRAL:
        if name in by_name:
            return by_name[name]
    raise InputError(folder, "neutral", "no pose is named so", f"Give --neutral, one of {', '.join(poses)}")


def _role(pose: str, neutral: str, heldout: tuple[str, ...]) -> str:
    return "neutral" if pose == neutral else "heldout" if pose in heldout else "example"


def _below(folder: str, fields: Mapping[str, Any]) -> dict[str, Any]:
    """The fields with their paths below a folder."""

    def moved(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: moved(item) for key, item in value.items()}
        return f"{folder}/{value}" if isinstance(value, str) and value.endswith((".ply", ".json")) else value

    return {key: moved(value) for key, value in fields.items()}


def _notes(
    folder: Path, neutral: str, poses: Mapping[str, Mapping[str, Path]], unused: list[Path]
) -> Iterator[str]:
    for pose, files in poses.items():
        yield f"{pose}: {', '.join(f'{kind} {file}' for kind, file in files.items())}"
    for file in unused:
        yield f"not used: {file}, since no volume has its name. Rename it if it belongs to a pose"
    for pose in (pose for pose, files in poses.items() if "labels" in files):
        yield f"the label map of {pose} shows whole bones? If it shows marrow, write `labels_show: marrow`"
    drawn = poses[neutral].get("seeds")
    if drawn is not None and not (seeds := folder / drawn).exists():
        yield f"to do: draw a stroke in each bone of {neutral} and some around them, and save them as {seeds}"
        yield f"to draw: 3D Slicer, ITK-SNAP, or handpipe draw SUBJECT {neutral}"
        yield "to have strokes of the bones that are found proposed: handpipe propose SUBJECT"
    bare = [pose for pose, files in poses.items() if "scan" not in files]
    if bare:
        yield f"no skin scan: {', '.join(bare)}. The volume gives the skin there, with air around the hand"
    if len(poses) == 1:
        yield "one pose only: the rig needs others to show how the joints move"
