# The files of poses: images, seeds, strokes, truth, and where a stage writes of each.

import functools
from pathlib import Path

from snakemake.exceptions import WorkflowError

from handpipe.core import paths
from handpipe.core.configuration import Role
from handpipe.hand import names_of_labels, require_seeds
from handpipe.imaging.volumes import labelled_names


def of_pose(field):
    """Input function: a file of the wildcards' pose as the dataset names it; absent optional files give none."""

    def files(wildcards):
        data = dataset(wildcards.subject)
        if wildcards.pose not in data.poses:
            raise WorkflowError(
                f"handpipe: {dataset_file(wildcards.subject)}: poses.{wildcards.pose}: is not a pose of "
                f"this subject. The poses are {', '.join(data.poses)}"
            )
        path = getattr(data.poses[wildcards.pose], field)
        return [] if path is None else data.path(path)

    return files


def echoes_of_pose(wildcards):
    """Input function: magnitude and phase of every echo of the pose, in the order of the dataset file."""
    data = dataset(wildcards.subject)
    dixon = data.poses[wildcards.pose].dixon
    if dixon is None:
        raise WorkflowError(
            f"handpipe: {dataset_file(wildcards.subject)}: poses.{wildcards.pose}.dixon: is not given, but "
            "fat and water are separated from it. Name its echoes"
        )
    return [data.path(p) for e in dixon.echoes for p in (e.magnitude, e.phase)]


def separated_images():
    """The figures of fat and water of every pose with Dixon echoes."""
    return [
        paths.at(paths.FAT_WATER, subject=subject, pose=name)
        for subject in buildable_subjects()
        for name, pose in dataset(subject).poses.items()
        if pose.dixon is not None
    ]


def channels_of_pose(wildcards):
    """Input function: the pose's further volumes, of which bones are learned; none where none are."""
    data = dataset(wildcards.subject)
    if data.contrast != "learned":
        return []
    return [data.path(p) for p in data.poses[wildcards.pose].channels.values()]


def registered_images(wildcards):
    """Input function: the images of neutral and of the pose, where they refine the registration."""
    data = dataset(wildcards.subject)
    if data.registration != "images":
        return []
    return volumes(wildcards.subject, [data.neutral, wildcards.pose])


def seeds_of_pose(wildcards):
    """The pose's seeds as the dataset names them, none where a label map answers; else the proposed ones."""
    given = of_pose("seeds")(wildcards)
    if given or wildcards.pose not in proposed_poses(wildcards.subject):
        return given
    return paths.at(paths.SEEDS, **wildcards)


@functools.cache
def in_label_map(subject, pose):
    """What a person's label map of a pose holds, by the names of the dataset; every name is checked."""
    data = whole_dataset(subject)
    file = data.poses[pose].labels
    if file is None:
        return ()
    names = names_of_labels(data)
    return tuple(checked(labelled_names, data.path(file), data.seed_labels, names))


@functools.cache
def proposed_poses(subject):
    """Poses whose seeds are proposed: without seeds, and with bones that no label map of theirs holds."""
    data = dataset(subject)
    missing = {
        name: [b for b in data.bones if b not in in_label_map(subject, name)]
        for name, pose in data.poses.items()
        if pose.seeds is None
    }
    whole = len(data.bones) == len(whole_dataset(subject).bones)
    checked(require_seeds, dataset_file(subject), data, missing, whole)
    return [name for name, bones in missing.items() if bones]


def in_poses(pattern, *roles):
    """Input function: a pattern over the subject's poses of the given roles (all where none is given)."""

    def files(wildcards):
        data = dataset(wildcards.subject)
        poses = data.poses_of(*(roles or Role))
        return expand(pattern, pose=poses, allow_missing=True)

    return files


def in_neutral(pattern):
    """Input function: the file of a pattern in the subject's neutral pose."""
    return lambda w: paths.at(pattern, subject=w.subject, pose=neutral(w.subject))


def in_truth(pattern, *roles):
    """Input function: the truth in poses of the given roles, where the subject has one.

    pattern: of a generated subject's file; a person's truth has files of the same names.
    """

    def files(wildcards):
        data = dataset(wildcards.subject)
        if data.truth is None:
            return []
        if data.generator:
            return in_poses(pattern, *roles)(wildcards)
        name = Path(pattern).name
        folder = data.path(data.truth.folder)
        return [folder / name.format(pose=p) for p in data.poses_of(*(roles or Role))]

    return files


def true_labels(wildcards):
    """Input function: true labels in every pose, of whole bones in neutral and of marrow elsewhere."""
    bones, marrow = (
        in_truth(pattern)(wildcards)
        for pattern in (paths.TRUE_BONES, paths.TRUE_MARROW)
    )
    is_neutral = [
        p == neutral(wildcards.subject) for p in dataset(wildcards.subject).poses
    ]
    return [b if n else m for b, m, n in zip(bones, marrow, is_neutral)]


def in_flesh(*roles):
    """Input function: the flesh in poses of the given roles, where the subject has one."""

    files = in_poses(paths.POSE_FLESH, *roles)
    return lambda w: files(w) if dataset(w.subject).fleshed else []


def where_neutral_is(wildcards):
    """Input function: the neutral pose, from which every other one is followed."""
    return (
        []
        if wildcards.pose == neutral(wildcards.subject)
        else in_neutral(paths.COUPLED_POSE)(wildcards)
    )


def scribbles(subject, pose, bone):
    """Extra seeds of one bone: a change there reruns that bone alone."""
    data = dataset(subject)
    extra = data.poses[pose].scribbles.get(bone)
    if extra is None:
        raise WorkflowError(
            f"handpipe: {dataset_file(subject)}: poses.{pose}.scribbles.{bone}: is not given. "
            "A bone without scribbles is in the pose's bones.h5"
        )
    return data.path(extra)


def all_scribbles(wildcards):
    """The scribbles of a pose, in the order of its corrected bones."""
    data = dataset(wildcards.subject)
    return [data.path(file) for file in data.poses[wildcards.pose].scribbles.values()]


def scribbled_bones(wildcards, input):
    """Bones that may lack seeds. As a function of `input` it reruns nothing: it decides failure alone."""
    return [*dataset(wildcards.subject).poses[wildcards.pose].scribbles]


def corrected_bones(wildcards):
    """The bones of a pose that have scribbles, each segmented again with them."""
    return expand(
        paths.CORRECTED,
        bone=dataset(wildcards.subject).poses[wildcards.pose].scribbles,
        allow_missing=True,
    )


def neutral_looks(wildcards):
    """How the bones look in neutral: what those of another pose are compared with."""
    pose = neutral(wildcards.subject)
    if wildcards.pose == pose:
        return []
    return in_neutral(paths.LOOKS)(wildcards)


def volumes(subject, poses):
    """The images of poses."""
    data = dataset(subject)
    return [data.path(data.poses[pose].volume) for pose in poses]


def neutral_volume(wildcards):
    data = dataset(wildcards.subject)
    return data.path(data.poses[data.neutral].volume)
