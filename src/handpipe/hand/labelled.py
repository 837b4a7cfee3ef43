"""What a person's label map of a pose holds of a subject: bones as surfaces, muscles as points."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from handpipe.core import Array, InputError
from handpipe.core.configuration import Dataset
from handpipe.imaging.bone_surfaces import APART, in_image, labelled_surfaces
from handpipe.imaging.segmentation import require_shown
from handpipe.imaging.volumes import Volume, read_label_map
from handpipe.mesh.surfaces import Surface

log = logging.getLogger(__name__)

BETWEEN = 1.0  # mm between the points on a muscle's boundary


def names_of_labels(dataset: Dataset) -> list[str]:
    """All names that a subject's label maps may hold.

    Parameters
    ----------
    dataset : Dataset
        The subject.

    Returns
    -------
    list of str
        Names of bones, other bones, and muscles.
    """
    return [*dataset.seed_labels, *dataset.muscles]


def require_seeds(
    source: str | Path, dataset: Dataset, missing: Mapping[str, Sequence[str]], whole: bool = True
) -> None:
    """Check that bones that no label map holds have seeds where none are proposed.

    Parameters
    ----------
    source : path
        Dataset file, for messages.
    dataset : Dataset
        What it says.
    missing : mapping of str to sequence of str
        By pose without seeds, the bones that its label map lacks.
    whole : bool
        Whether the dataset has all bones of its file; seeds are proposed from all of them alone.

    Raises
    ------
    InputError
        For the first pose with such bones: neutral, or any where the dataset is a part.
    """
    for name, bones in missing.items():
        if bones and (name == dataset.neutral or not whole):
            problem = f"{dataset.poses[name].labels} lacks {', '.join(bones)}, and the pose has no seeds"
            raise InputError(source, f"poses.{name}.labels", problem, "Add these bones, or seeds of them")


def labelled_bones(path: Path | None, dataset: Dataset, pose: str, volume: Volume) -> dict[str, Surface]:
    """Surfaces of the bones that a person's label map of a pose holds.

    Parameters
    ----------
    path : path or None
        The label map; None where the pose has none.
    dataset : Dataset
        The subject: labels of bones, and what the pose's map shows of them.
    pose : str
        Name of the pose.
    volume : Volume
        Its image.

    Returns
    -------
    dict of str to Surface
        Closed surfaces in mm of the bones that are modelled and of other bones, by name.

    Raises
    ------
    InputError
        For a map that cannot be read, does not lie in the image, or shows something else of its bones than
        the dataset says; for bones that are empty or in several pieces.
    """
    if path is None:
        return {}
    labels, shown = read_label_map(path, dataset.seed_labels), dataset.poses[pose].labels_show
    known = labels.known(dataset.seed_labels)
    for name in (name for name, label in labels.numbers.items() if label not in known.values()):
        log.info("%s: %s is no bone of the dataset", path, name)
    found = labelled_surfaces(labels, known, APART if shown == "marrow" else 0.0)
    seen = {name: in_image(volume, surface, path, name) for name, surface in found.items()}
    require_shown(volume, seen, shown, path)
    return seen


def labelled_muscles(path: Path | None, dataset: Dataset) -> dict[str, Array]:
    """Points (n, 3) in mm on the boundaries of the muscles that a person's label map of a pose holds.

    Parameters
    ----------
    path : path or None
        The label map; None where the pose has none.
    dataset : Dataset
        The subject: labels of bones, and names of muscles.

    Returns
    -------
    dict of str to array (n, 3)
        Points about `BETWEEN` mm apart, by muscle.

    Raises
    ------
    InputError
        For a map that cannot be read, and for muscles that are empty or in several pieces.
    """
    if path is None:
        return {}
    labels = read_label_map(path, dataset.seed_labels)
    found = labelled_surfaces(labels, labels.known(dataset.muscles))
    return {name: _thinned(surface.vertices) for name, surface in found.items()}


def _thinned(points: Array) -> Array:
    """One point of each cube of `BETWEEN` mm."""
    _, first = np.unique(np.floor(points / BETWEEN), axis=0, return_index=True)
    return points[np.sort(first)]
