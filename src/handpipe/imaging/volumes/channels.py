"""Further images of a pose on the grid of its volume."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from handpipe.core import InputError
from handpipe.core.configuration import Dataset
from handpipe.imaging.formats.lattice import on_grid
from handpipe.imaging.formats.stored import Stored
from handpipe.imaging.volumes.volume import Volume, read_volume


def read_channel(path: str | Path, like: Volume) -> Volume:
    """An image on the lattice of another one, whatever order its file stores its axes in.

    Parameters
    ----------
    path : str or Path
        A file, or a folder of DICOM images.
    like : Volume
        The volume of the pose.

    Returns
    -------
    Volume
        Intensities on the grid of `like`.

    Raises
    ------
    InputError
        As `read_volume` does; if the image has another lattice.
    """
    path = Path(path)
    own = read_volume(path)
    try:
        values = on_grid(path, Stored(own.values, own.affine), like.shape, like.affine)
    except InputError as error:
        remedy = "Resample it to the grid of the pose's volume"
        raise InputError(error.source, error.field, error.problem, remedy) from error
    return like.like(np.asarray(values))


def pose_channels(dataset: Dataset, pose: str, volume: Volume) -> dict[str, Volume]:
    """The channels of a pose, on the grid of its volume.

    Parameters
    ----------
    dataset : Dataset
        Dataset of the subject.
    pose : str
        Name of one of its poses.
    volume : Volume
        Its volume.

    Returns
    -------
    dict of str to Volume
        Channels by name, in the order of the dataset file; without `volume` itself.

    Raises
    ------
    InputError
        As `read_channel` does.
    """
    chosen = dataset.poses[pose].channels
    return {name: read_channel(dataset.path(path), volume) for name, path in chosen.items()}
