"""A subject's files, and what its dataset file says of joints and scans."""

from __future__ import annotations

from math import radians
from pathlib import Path

from handpipe.core import InputError
from handpipe.core.configuration import Dataset, Muscle
from handpipe.skeleton.rig import ANY_ANGLE


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
        found |= {
            f"poses.{name}.{part}": getattr(pose, part) for part in ("volume", "seeds", "labels", "scan")
        }
        for part in ("channels", "scribbles", "markers", "landmarks"):
            found |= {f"poses.{name}.{part}.{key}": path for key, path in getattr(pose, part).items()}
        for number, echo in enumerate(pose.dixon.echoes if pose.dixon else ()):
            found |= {
                f"poses.{name}.dixon.echoes.{number}.{part}": getattr(echo, part)
                for part in ("magnitude", "phase")
            }
    found |= {f"bones.{name}.template": bone.template for name, bone in dataset.bones.items()}
    for field, organ in organs(dataset).items():
        found |= {
            f"{field}.{part}": getattr(organ, part) for part in ("template", "attachments", "landmarks")
        }
    found |= {f"tendons.{name}.path": tendon.path for name, tendon in dataset.tendons.items()}
    found |= {f"nails.{name}.surface": nail.surface for name, nail in dataset.nails.items()}
    found |= {f"regions.{fascia}": path for fascia, path in dataset.regions.items()}
    return {field: dataset.path(path) for field, path in found.items() if path is not None}


def organs(dataset: Dataset) -> dict[str, Muscle]:
    """What is made as a muscle is, by field: muscles and ligaments."""
    kinds = {"muscles": dataset.muscles, "ligaments": dataset.ligaments}
    return {f"{kind}.{name}": organ for kind, organs in kinds.items() for name, organ in organs.items()}


def unusable_files(source: str | Path, dataset: Dataset) -> dict[Path, InputError]:
    """Paths that the dataset file `source` names and that cannot be used, each with what is wrong."""
    found: dict[Path, InputError] = {}
    for field, path in named_files(dataset).items():
        try:
            require_plain(source, field, path)
            if not path.exists():
                remedy = "Check the path; it is relative to the dataset's root"
                raise InputError(source, field, f"{path} does not exist", remedy)
        except InputError as error:
            found[path] = error
    return found


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
    for error in unusable_files(source, dataset).values():
        raise error


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


def require_skin(source: str | Path, dataset: Dataset, pose: str, layer: str) -> Path | None:
    """Path of the skin scan of a pose, which a layer needs; None where the pose's volume gives the skin.

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
    Path or None
        Resolved path of the scan.

    Raises
    ------
    InputError
        Where the dataset names no scan of the pose, and its volume gives no skin.
    """
    scan = dataset.poses[pose].scan
    if not dataset.has_skin(pose):
        problem = f"is not given, but the layer {layer} is made of it"
        remedy = "Name one, set skin_from_volume: true, or leave the layer out"
        raise InputError(source, f"poses.{pose}.scan", problem, remedy)
    return None if scan is None else dataset.path(scan)


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
        stated = joint.limits_deg or ANY_ANGLE * len(joint.angles)
        for angle, (lower, upper) in zip(joint.angles, stated, strict=True):
            limits[angle] = (radians(lower), radians(upper))
    return limits
