"""A dataset file for a folder of scans: what is found there, and the template hand for all else."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Literal

import yaml

from handpipe.anatomy import shipped
from handpipe.cli.first_scene import scene_files, write_first_scene
from handpipe.cli.found_files import TEMPLATE, VOLUMES, find_poses
from handpipe.cli.own_bones import own_bones
from handpipe.cli.scan_frames import own_frames
from handpipe.core import InputError, write_text
from handpipe.core.configuration import load_dataset

NEUTRAL = ("neutral", "rest", "relaxed", "flat")  # names of a pose that is taken for neutral, best first
HEADER = """\
# Written by `handpipe init`; config/README.md explains each field. Edit it freely: nothing overwrites it.
"""
OF_TEMPLATE = "# Bones, joints and organs are those of the template hand; their files are in {template}.\n"
OF_PERSON = """\
# Bones are numbered as the joints name them; labels of a seed volume have to be these, or edit them here.
# Ball joints have axes of the neutral image; where a joint is a hinge, leave one angle with a rough axis.
"""


def init(
    name: str,
    folder: Path,
    side: Literal["right", "left"],
    neutral: str | None = None,
    heldout: tuple[str, ...] = (),
    only: tuple[str, ...] = (),
    joints: tuple[str, ...] = (),
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
    joints : tuple of str
        Joints of other bones than the template's, as `own_bones` takes them; nothing is then taken from it.

    Returns
    -------
    path : Path
        The dataset file.
    notes : list of str
        What was found, and what is to be done before the build.

    Raises
    ------
    InputError
        Where there is such a dataset, no volume, or no pose that may be neutral, and as `own_bones` and
        `shipped.bones_of_part`.
    """
    path = Path(f"config/datasets/{name}.yaml")
    anatomy, header, install = _anatomy(folder / TEMPLATE, side, only, joints)
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
    elsewhere = own_frames(folder, poses)
    content: dict[str, Any] = {
        "name": name,
        "root": str(folder),
        "units": "mm",
        "hand": side,
        "poses": {
            pose: {"role": _role(pose, rest, heldout)}
            | {field: str(file) for field, file in files.items()}
            | ({"scan_frame": "own"} if pose in elsewhere else {})
            for pose, files in sorted(poses.items(), key=lambda item: (item[0] != rest, item[0]))
        },
    }
    if "scan" not in poses[rest]:
        content["skin_from_volume"] = True
    text = yaml.safe_dump(content | anatomy, sort_keys=False, default_flow_style=None, width=110)
    write_text(path, HEADER + header + _with_comments(text, elsewhere))
    had_template = (folder / TEMPLATE).exists()
    try:
        write_first_scene(name, load_dataset(path))
        install()
    except BaseException:  # nothing is half-written: the same command can be repeated
        for file in (path, *scene_files(name)):
            file.unlink(missing_ok=True)
        if not had_template:
            shutil.rmtree(folder / TEMPLATE, ignore_errors=True)
        raise
    unused = [file for pose, files in found.items() if pose not in poses for file in files.values()]
    notes = _notes(folder, rest, poses, unused)
    return path, [*notes, *(f"scan_frame: own is written for {p}: {why}" for p, why in elsewhere.items())]


def _anatomy(
    folder: Path, side: Literal["right", "left"], only: tuple[str, ...], joints: tuple[str, ...]
) -> tuple[dict[str, Any], str, Callable[[], object]]:
    """Fields of bones, joints and organs; a comment on them; what writes the template's files, if any."""
    if joints and only:
        raise InputError(
            "--only", "parts", "are of the template hand, and --joint names other bones", "Give one"
        )
    if joints:
        return own_bones(joints), OF_PERSON, lambda: None
    bones = shipped.bones_of_part(shipped.fields_of(side), only) if only else None
    fields = _below(TEMPLATE, shipped.fields_of(side, bones=bones)) | {"drawn_in": "template"}
    install = partial(shipped.install, folder, side, bones=bones)
    return fields, OF_TEMPLATE.format(template=folder), install


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


def _with_comments(text: str, comments: Mapping[str, str]) -> str:
    """YAML with a comment before the entry of each pose that has one."""
    for pose, comment in comments.items():
        text = text.replace(f"\n  {pose}: {{role", f"\n  # {comment}\n  {pose}: {{role", 1)
    return text


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
