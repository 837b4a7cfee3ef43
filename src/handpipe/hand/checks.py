"""All that is wrong with a subject's files, found before its build starts."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

from handpipe.core import HandpipeError, InputError
from handpipe.core.configuration import Dataset, Muscle
from handpipe.hand.labelled import labelled_bones, labelled_muscles, names_of_labels, require_seeds
from handpipe.hand.subject import organs, unusable_files
from handpipe.imaging.evidence import read_landmarks, read_markers
from handpipe.imaging.fat_water import read_echoes
from handpipe.imaging.segmentation import check_seeds
from handpipe.imaging.volumes import (
    Foreground,
    Volume,
    labelled_names,
    pose_volume,
    read_channel,
    read_labels,
    require_points_in_image,
    require_scan_in_image,
)
from handpipe.mesh.files import read_scan, read_surface
from handpipe.mesh.surfaces import Surface
from handpipe.tissues.muscles.fitting import read_attachments, require_near_bones

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Check:
    """One thing that is asked of a subject's files.

    Parameters
    ----------
    files : tuple of Path
        What it reads.
    run : callable
        Raises a `HandpipeError` where the files do not have it.
    """

    files: tuple[Path, ...]
    run: Callable[[], object]


def faults(source: str | Path, dataset: Dataset) -> list[HandpipeError]:
    """Every fault of a subject's files, in the order in which they are read.

    A file that is missing or cannot be read is named once: what compares it with others is left out.

    Parameters
    ----------
    source : path
        Dataset file, for the messages.
    dataset : Dataset
        What it says.

    Returns
    -------
    list of HandpipeError
        Each names file, field, problem and remedy.
    """
    found: list[HandpipeError] = []
    unusable: set[Path] = set()
    for path, error in unusable_files(source, dataset).items():
        found.append(error)
        unusable.add(path)
    for check in checks(dataset):
        if unusable.intersection(check.files):
            continue
        try:
            check.run()
        except HandpipeError as error:
            found.append(error)
            if len(check.files) == 1:
                unusable.update(check.files)
    return found


def checks(dataset: Dataset) -> Iterator[Check]:
    """What is asked of a dataset's files: first of each alone, then of each with the images.

    Parameters
    ----------
    dataset : Dataset
        What a dataset file says.

    Yields
    ------
    Check
        To be run before the next one is asked for: an image is kept no longer than it is needed.
    """
    yield from _surface_checks(dataset)
    yield from _image_checks(dataset)
    yield from _frame_checks(dataset)


def _surface_checks(dataset: Dataset) -> Iterator[Check]:
    """Scans, templates, attachments, nails and marks that can be read; templates near their bones."""
    for pose in dataset.poses.values():
        if pose.scan is not None:
            yield _reads(read_scan, dataset.path(pose.scan))
        for path in pose.markers.values():
            yield _reads(read_markers, dataset.path(path))
        for path in pose.landmarks.values():
            yield _reads(read_landmarks, dataset.path(path))
    closed = cache(partial(read_surface, closed=True))
    templates = {n: dataset.path(b.template) for n, b in dataset.bones.items() if b.template is not None}
    for template in templates.values():
        yield _reads(closed, template)
    for organ in organs(dataset).values():
        template, attachments = dataset.path(organ.template), dataset.path(organ.attachments)
        yield _reads(closed, template)
        run = partial(_check_attachments, dataset, organ, templates, closed)
        yield Check((template, attachments, *templates.values()), run)
        if organ.landmarks is not None:
            yield _reads(read_landmarks, dataset.path(organ.landmarks))
    for nail in dataset.nails.values():
        yield _reads(read_surface, dataset.path(nail.surface))
    for tendon in dataset.tendons.values():
        yield _reads(read_markers, dataset.path(tendon.path))


def _reads(read: Callable[[Path], object], path: Path) -> Check:
    return Check((path,), partial(read, path))


def _check_attachments(
    dataset: Dataset, organ: Muscle, templates: Mapping[str, Path], read: Callable[[Path], Surface]
) -> None:
    """Raise `InputError` for an attachment to what is not there, or to a bone that is far away."""
    template, path = read(dataset.path(organ.template)), dataset.path(organ.attachments)
    attached = read_attachments(path, template)
    for name in attached:
        if name not in dataset.bones:
            problem = "is not a bone of the dataset"
            raise InputError(path, name, problem, f"The bones are {', '.join(dataset.bones)}")
    bones = {name: read(file) for name, file in templates.items()}
    require_near_bones(dataset.path(organ.template), template, attached, bones)


def _image_checks(dataset: Dataset) -> Iterator[Check]:
    """Volumes that can be read, their channels and echoes, and the seeds and scribbles drawn on them."""
    for name, pose in dataset.poses.items():
        path, volume = dataset.path(pose.volume), cache(partial(pose_volume, dataset, name))
        yield Check((path,), partial(_check_contrast, path, volume))
        for channel in map(dataset.path, pose.channels.values()):
            yield Check((path, channel), partial(_check_channel, channel, volume))
        if pose.dixon is not None:
            files = [dataset.path(p) for e in pose.dixon.echoes for p in (e.magnitude, e.phase) if p]
            yield Check((path, *files), partial(read_echoes, dataset, name))
        labels = () if pose.labels is None else (dataset.path(pose.labels),)
        for file in labels:
            yield Check((file,), partial(_labelled, dataset, name))
            yield Check((path, file), partial(_check_labels, dataset, name, file, volume))
        if pose.seeds is not None:
            seeds = dataset.path(pose.seeds)
            yield Check((path, seeds, *labels), partial(_check_seeds, dataset, name, seeds, volume))
        for scribbles in map(dataset.path, pose.scribbles.values()):
            yield Check((path, scribbles), partial(_check_scribbles, dataset, scribbles, volume))


def _check_contrast(path: Path, volume: Callable[[], Volume]) -> None:
    values = volume().values
    if values.min() == values.max():
        raise InputError(path, "values", f"is {values.min():g} everywhere", "Export it again")


def _check_channel(path: Path, volume: Callable[[], Volume]) -> None:
    _check_contrast(path, cache(partial(read_channel, path, volume())))


def _check_seeds(dataset: Dataset, pose: str, path: Path, volume: Callable[[], Volume]) -> None:
    seeds = read_labels(path, volume(), dataset.seed_labels)
    answered = {*dataset.poses[pose].scribbles, *_labelled(dataset, pose)}
    check_seeds(path, seeds, dataset.labels, answered, dataset.other_labels)


def _labelled(dataset: Dataset, pose: str) -> list[str]:
    """What the label map of a pose holds."""
    file = dataset.poses[pose].labels
    if file is None:
        return []
    return labelled_names(dataset.path(file), dataset.seed_labels, names_of_labels(dataset))


def _check_labels(dataset: Dataset, pose: str, path: Path, volume: Callable[[], Volume]) -> None:
    """Raise `InputError` for bones and muscles that cannot be used, that have scribbles, or lack seeds."""
    present = _labelled(dataset, pose)
    labelled_bones(path, dataset, pose, volume())
    labelled_muscles(path, dataset)
    for bone in (bone for bone in dataset.poses[pose].scribbles if bone in present):
        problem = f"holds {bone}, which has scribbles, too"
        raise InputError(path, f"poses.{pose}.scribbles", problem, "Remove one of them")
    if dataset.poses[pose].seeds is None:
        missing = [bone for bone in dataset.bones if bone not in present]
        require_seeds(dataset.name, dataset, {pose: missing})


def _check_scribbles(dataset: Dataset, path: Path, volume: Callable[[], Volume]) -> None:
    read_labels(path, volume(), dataset.seed_labels)


def _frame_checks(dataset: Dataset) -> Iterator[Check]:
    """Scans, marks, tendons' paths and nails that lie in the image of their pose.

    Others are in another frame or unit, or of another pose. Scans in their own frame are judged when they are
    aligned.
    """
    images = {name: cache(partial(_image, dataset, name)) for name in dataset.poses}
    volumes = {name: dataset.path(pose.volume) for name, pose in dataset.poses.items()}
    for name, pose in dataset.poses.items():
        if pose.scan is not None and pose.scan_frame == "volume":
            path = dataset.path(pose.scan)
            yield Check((path, volumes[name]), partial(_check_scan, path, name, images))
        for marks in map(dataset.path, (*pose.markers.values(), *pose.landmarks.values())):
            run = partial(_check_marks, marks, images[name], f"the image of pose {name}")
            yield Check((marks, volumes[name]), run)
    if dataset.drawn_in == "template":
        return
    neutral = dataset.neutral
    for tendon in dataset.tendons.values():
        path = dataset.path(tendon.path)
        run = partial(_check_marks, path, images[neutral], "the image of neutral")
        yield Check((path, volumes[neutral]), run)
    for nail in dataset.nails.values():
        path = dataset.path(nail.surface)
        yield Check((path, volumes[neutral]), partial(_check_nail, path, images[neutral]))


def _image(dataset: Dataset, pose: str) -> Foreground:
    return Foreground.threshold(pose_volume(dataset, pose))


def _check_scan(path: Path, pose: str, images: Mapping[str, Callable[[], Foreground]]) -> None:
    others = {other: make for other, make in images.items() if other != pose}
    agreement = require_scan_in_image(path, read_scan(path), images[pose](), others)
    log.info("%s: Dice coefficient %.2f with the body in the image of %s", path, agreement, pose)


def _check_marks(path: Path, image: Callable[[], Foreground], where: str) -> None:
    points, labels = read_markers(path)
    require_points_in_image(path, points, labels, image(), where)


def _check_nail(path: Path, image: Callable[[], Foreground]) -> None:
    points = read_surface(path).compact().vertices
    labels = [str(i) for i in range(len(points))]
    require_points_in_image(path, points, labels, image(), "the image of neutral")
