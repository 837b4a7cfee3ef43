"""A subject's files before its build starts: all there, and each what the dataset file says it is."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache
from math import radians
from pathlib import Path

from handpipe.core import InputError
from handpipe.core.configuration import Dataset, Muscle
from handpipe.imaging.evidence import read_landmarks, read_markers
from handpipe.imaging.segmentation import check_seeds
from handpipe.imaging.volumes import (
    Foreground,
    pose_volume,
    read_labels,
    require_points_in_image,
    require_scan_in_image,
)
from handpipe.mesh.surfaces import read_scan, read_surface
from handpipe.tissues.muscles.fitting import read_attachments, require_near_bones

log = logging.getLogger(__name__)


def named_files(dataset: Dataset) -> dict[str, Path]:
    """Path of every file that a dataset names.

    Parameters
    ----------
    dataset : Dataset
        The subject.

    Returns
    -------
    mapping of str to Path
        Resolved path by field, e.g. "poses.fist.volume".
    """
    found: dict[str, Path | None] = {}
    for name, pose in dataset.poses.items():
        found |= {f"poses.{name}.{part}": getattr(pose, part) for part in ("volume", "seeds", "scan")}
        for part in ("scribbles", "markers", "landmarks"):
            found |= {f"poses.{name}.{part}.{key}": path for key, path in getattr(pose, part).items()}
    found |= {f"bones.{name}.template": bone.template for name, bone in dataset.bones.items()}
    for field, organ in _organs(dataset).items():
        found |= {
            f"{field}.{part}": getattr(organ, part) for part in ("template", "attachments", "landmarks")
        }
    found |= {f"tendons.{name}.path": tendon.path for name, tendon in dataset.tendons.items()}
    found |= {f"nails.{name}.surface": nail.surface for name, nail in dataset.nails.items()}
    found |= {f"regions.{fascia}": path for fascia, path in dataset.regions.items()}
    return {field: dataset.path(path) for field, path in found.items() if path is not None}


def _organs(dataset: Dataset) -> dict[str, Muscle]:
    """What is made as a muscle is, by field: muscles and ligaments."""
    kinds = {"muscles": dataset.muscles, "ligaments": dataset.ligaments}
    return {f"{kind}.{name}": organ for kind, organs in kinds.items() for name, organ in organs.items()}


def require_files(source: str | Path, dataset: Dataset) -> None:
    """Check that every file that a dataset names exists and has a name that the workflow can use.

    Parameters
    ----------
    source : path
        The file of the dataset, for messages.
    dataset : Dataset
        The subject.

    Raises
    ------
    InputError
        For the first file that cannot be used.
    """
    for field, path in named_files(dataset).items():
        require_plain(source, field, path)
        if not path.exists():
            problem = f"{path} does not exist"
            raise InputError(source, field, problem, "Check the path; it is relative to the dataset's root")


def require_plain(source: str | Path, field: str, path: Path) -> None:
    """Check that a path has no braces, which the workflow would take for a wildcard.

    Parameters
    ----------
    source : path
        The file that names the path, for messages.
    field : str
        The field that names the path, for messages.
    path : Path
        Path that is checked.

    Raises
    ------
    InputError
        For a path with braces.
    """
    if "{" in str(path) or "}" in str(path):
        remedy = "Rename the file or folder; blanks, brackets and accents are no obstacle"
        raise InputError(source, field, f"{path} has braces in its name", remedy)


def require_scan(source: str | Path, dataset: Dataset, pose: str, layer: str) -> Path:
    """Path of the skin scan of a pose, which a layer needs.

    Parameters
    ----------
    source : path
        The file of the dataset, for messages.
    dataset : Dataset
        The subject.
    pose : str
        Name of the pose.
    layer : str
        Name of the layer that is made of the scan, for messages.

    Returns
    -------
    Path
        Resolved path of the scan.

    Raises
    ------
    InputError
        Where the dataset names no scan of the pose.
    """
    scan = dataset.poses[pose].scan
    if scan is None:
        problem = f"is not given, but the layer {layer} is made of it"
        remedy = "Name one, or leave the layer out (skin needs neutral's scan, fat every example's too)"
        raise InputError(source, f"poses.{pose}.scan", problem, remedy)
    return dataset.path(scan)


def check_surfaces(dataset: Dataset) -> None:
    """Read every scan, template, attachment, nail and file of marks of a dataset.

    Parameters
    ----------
    dataset : Dataset
        The subject.

    Raises
    ------
    InputError
        For a file that cannot be read or is in the wrong unit, a scan with islands, a template that is open,
        an attachment to a bone that the dataset lacks or to vertices that the template lacks, and a template
        that is far from the template bones to which it attaches.
    """
    for pose in dataset.poses.values():
        if pose.scan is not None:
            read_scan(dataset.path(pose.scan))
        for path in pose.markers.values():
            read_markers(dataset.path(path))
        for path in pose.landmarks.values():
            read_landmarks(dataset.path(path))
    bones = {
        name: read_surface(dataset.path(bone.template), closed=True)
        for name, bone in dataset.bones.items()
        if bone.template is not None
    }
    for organ in _organs(dataset).values():
        template = read_surface(dataset.path(organ.template), closed=True)
        attachments = dataset.path(organ.attachments)
        attached = read_attachments(attachments, template)
        for name in attached:
            if name not in dataset.bones:
                problem = "is not a bone of the dataset"
                raise InputError(attachments, name, problem, f"The bones are {', '.join(dataset.bones)}")
        require_near_bones(dataset.path(organ.template), template, attached, bones)
        if organ.landmarks is not None:
            read_landmarks(dataset.path(organ.landmarks))
    for nail in dataset.nails.values():
        read_surface(dataset.path(nail.surface))
    for tendon in dataset.tendons.values():
        read_markers(dataset.path(tendon.path))


def check_frames(dataset: Dataset) -> None:
    """Compare every scan and every file of marks with the image of its pose.

    Parameters
    ----------
    dataset : Dataset
        The subject.

    Raises
    ------
    InputError
        For a scan that does not fit the image of its pose, and for marks, a tendon's path or a nail outside
        the image: they are in another frame or unit, or of another pose.
    """
    images = {name: _image(dataset, name) for name in dataset.poses}
    for name, pose in dataset.poses.items():
        if pose.scan is not None:
            path = dataset.path(pose.scan)
            others = {other: make for other, make in images.items() if other != name}
            agreement = require_scan_in_image(path, read_scan(path), images[name](), others)
            log.info("%s: Dice coefficient %.2f with the body in the image of %s", path, agreement, name)
        for marks in (*pose.markers.values(), *pose.landmarks.values()):
            _require_in_image(dataset.path(marks), images[name](), f"the image of pose {name}")
    neutral = images[dataset.neutral]
    for tendon in dataset.tendons.values():
        _require_in_image(dataset.path(tendon.path), neutral(), "the image of neutral")
    for nail in dataset.nails.values():
        path = dataset.path(nail.surface)
        points = read_surface(path).compact().vertices
        labels = [str(i) for i in range(len(points))]
        require_points_in_image(path, points, labels, neutral(), "the image of neutral")


def _image(dataset: Dataset, pose: str) -> Callable[[], Foreground]:
    """The body in a pose's image, read when it is first asked for."""
    return cache(lambda: Foreground.of(pose_volume(dataset, pose)))


def _require_in_image(path: Path, image: Foreground, where: str) -> None:
    points, labels = read_markers(path)
    require_points_in_image(path, points, labels, image, where)


def check_images(dataset: Dataset) -> None:
    """Read every volume, and the seeds and scribbles that were drawn on it.

    Parameters
    ----------
    dataset : Dataset
        The subject.

    Raises
    ------
    InputError
        For an image that cannot be read, is no volume or lies on another grid, for labels of no bone, and
        for a bone or a background of neutral without seeds.
    """
    for name, pose in dataset.poses.items():
        volume = pose_volume(dataset, name)
        if volume.values.min() == volume.values.max():
            problem = f"is {volume.values.min():g} everywhere"
            raise InputError(dataset.path(pose.volume), "values", problem, "Export it again")
        if pose.seeds is not None:
            path = dataset.path(pose.seeds)
            seeds = read_labels(path, volume, dataset.seed_labels)
            check_seeds(path, seeds, dataset.labels, pose.scribbles, dataset.other_labels)
        for scribbles in pose.scribbles.values():
            read_labels(dataset.path(scribbles), volume, dataset.seed_labels)


def joint_limits(dataset: Dataset) -> dict[str, tuple[float, float]]:
    """Lower and upper limit of every joint angle.

    Parameters
    ----------
    dataset : Dataset
        The subject; an angle without limits gets half a turn in both directions.

    Returns
    -------
    mapping of str to tuple of float
        Lower and upper limit in rad by angle.
    """
    limits = {}
    for joint in dataset.joints.values():
        stated = joint.limits_deg or ((-180.0, 180.0),) * len(joint.angles)
        for angle, (lower, upper) in zip(joint.angles, stated, strict=True):
            limits[angle] = (radians(lower), radians(upper))
    return limits
