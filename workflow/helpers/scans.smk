# The skin of poses: scans, or what their volumes show.

from pathlib import Path

from snakemake.exceptions import WorkflowError

from handpipe.core import paths
from handpipe.hand import require_skin
from handpipe.mesh.files import texture_files


def scanned(subject):
    """Poses with a skin, of a scan or of their volume, other than neutral."""
    data = dataset(subject)
    return [n for n in data.poses if n != data.neutral and data.has_skin(n)]


def skin_of(subject, pose):
    """The skin of a pose that has one: its scan, aligned if in its own frame, else what its volume gives."""
    data = dataset(subject)
    if data.poses[pose].scan is None:
        return paths.at(paths.VOLUME_SKIN, subject=subject, pose=pose)
    if data.poses[pose].scan_frame == "own":
        return paths.at(paths.ALIGNED_SCAN, subject=subject, pose=pose)
    return data.path(data.poses[pose].scan)


def skins_from_volumes(wildcards):
    """Input function: figures of the skins that come from volumes."""
    data = dataset(wildcards.subject)
    bare = [p for p, pose in data.poses.items() if data.has_skin(p) and not pose.scan]
    return expand(paths.VOLUME_SKIN_FIGURES, subject=wildcards.subject, pose=bare)


def neutral_from_volume(wildcards):
    """Input function: figures of the neutral skin, where it comes from the volume."""
    data = dataset(wildcards.subject)
    if data.poses[data.neutral].scan or not data.has_skin(data.neutral):
        return []
    return in_neutral(paths.VOLUME_SKIN_FIGURES)(wildcards)


def neutral_skin(wildcards):
    """Input function: the neutral skin, which tells parts that touch in another pose apart."""
    subject = wildcards.subject
    if wildcards.pose == neutral(subject) or not dataset(subject).has_skin(
        neutral(subject)
    ):
        return []
    return skin_of(subject, neutral(subject))


def aligned_scans(subject):
    """Poses whose scan is aligned for the scenes: neutral's for any skin, the others' for fat."""
    data, layers = dataset(subject), scene_layers()
    needed_in = [data.neutral] if "skin" in layers else []
    needed_in = data.poses if "fat" in layers else needed_in
    own = [n for n in needed_in if data.poses[n].scan_frame == "own"]
    return [n for n in own if data.poses[n].scan]


def scans(subject, poses):
    """The scans of those poses that have one; what volumes give, too, where the fat is fitted to it."""
    data, fat = dataset(subject), "fat" in scene_layers()
    has = data.has_skin if fat else lambda pose: data.poses[pose].scan is not None
    return [skin_of(subject, p) for p in poses if has(p)]


def scanned_files(subject):
    """What a person would have of a subject: images, scans, and seeds where a pose has its own."""
    data = dataset(subject)
    seeds = [data.path(pose.seeds) for pose in data.poses.values() if pose.seeds]
    return [*volumes(subject, data.poses), *scans(subject, data.poses), *seeds]


def neutral_scan(wildcards):
    data = dataset(wildcards.subject)
    return needed_scan(wildcards.subject, data.neutral, "skin")


def neutral_scan_file(wildcards):
    """The scan of the neutral pose as its file is, before it is aligned; else what the volume gives."""
    data = dataset(wildcards.subject)
    scan = data.poses[data.neutral].scan
    return neutral_scan(wildcards) if scan is None else data.path(scan)


def textures_of_scan(wildcards):
    """The materials and images that the neutral scan names; of a scan that is generated, none."""
    file = neutral_scan_file(wildcards)
    return checked(texture_files, file) if Path(file).exists() else []


def example_scan(wildcards):
    return needed_scan(wildcards.subject, wildcards.pose, "fat")


def needed_scan(subject, pose, layer):
    """A pose's skin that a layer is made of; where there is none the build ends before it begins."""
    if len(dataset(subject).bones) < len(whole_dataset(subject).bones):
        raise WorkflowError(
            f"handpipe: {', '.join(SETTINGS.scenes)}: only: {layer} is made of the skin around all bones. "
            "Remove `only` from the scenes, or build another target"
        )
    checked(require_skin, dataset_file(subject), dataset(subject), pose, layer)
    return skin_of(subject, pose)
