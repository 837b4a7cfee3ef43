# What a report shows: stages, tables and poses.

from handpipe.core import paths
from handpipe.core.configuration import Role
from handpipe.skeleton.motion import is_motion


def report_stages(subject):
    """The stages that the scenes ask for, by the names of their figures."""
    data, layers = dataset(subject), scene_layers()
    stages = ["seeds"] if proposed_poses(subject) else []
    stages += ["segmentation", "registration", "rig"]
    stages += ["tendons"] if "tendons" in layers and data.tendons else []
    stages += ["muscles"] if "muscles" in layers and data.muscles else []
    stages += [f"scan-{pose}" for pose in aligned_scans(subject)]
    stages += ["skin"] if "fat" in layers else []
    stages += ["poses"] if report_poses(subject) else []
    stages += ["images"] if poses_with_moved_images(subject) else []
    stages += ["deviations"] if states_deviations() else []
    stages += [f"frames-{name}" for name in SETTINGS.scenes]
    stages += [
        f"motion-{name}" for name in SETTINGS.scenes if is_motion(scene(name).frames)
    ]
    return stages


def report_tables(subject):
    """The tables of these stages that the report shows."""
    stages = [
        stage
        for stage in report_stages(subject)
        if stage in ("rig", "muscles", "skin", "poses") or stage.startswith("frames-")
    ]
    return expand(paths.TABLE, subject=subject, stage=stages)


def poses_in_report(subject):
    """Simulated scanned poses that the report draws: those that other stages need, too."""
    data, layers = dataset(subject), scene_layers()
    if "fat" in layers:
        return [data.neutral, *scanned(subject)]
    if "muscles" in layers and data.muscles:
        return data.poses_of(Role.example, Role.heldout)
    return []


def report_poses(subject):
    """The files of these poses."""
    if "fat" in scene_layers():
        poses = poses_in_report(subject)
        return expand([paths.POSE_INNER, paths.POSE_SKIN], subject=subject, pose=poses)
    return muscle_poses(subject) if poses_in_report(subject) else []


def fat_fits(subject):
    """The fits of the fat's strains to scans, where a scene needs them."""
    poses = dataset(subject).examples if "fat" in scene_layers() else []
    return expand(paths.FAT_FIT, subject=subject, pose=poses)
