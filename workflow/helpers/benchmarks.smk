# What benchmarks read of built subjects.

from handpipe.core import artifacts_of, paths
from handpipe.core.configuration import load_dataset, load_scene

SEQUENCES = ("close-fist", "thumb-opposition", "performance", "numbers", "sign-letters")


def as_built(subject, name):
    """What a benchmark reads of a built subject to simulate the layers of a scene."""
    data, file = (
        checked(load_dataset, dataset_file(subject)),
        f"config/scenes/{name}.yaml",
    )
    layers = artifacts_of(checked(load_scene, file).needed, data)
    built = [paths.RIG, *(f"{paths.SUBJECT}/{path}" for path in layers)]
    return [dataset_file(subject), file, *expand(built, subject=subject)]


def simulated_frames(subject, name):
    """The frames of a scene, and what a benchmark reads to simulate some of them again."""
    numbers = chunks(subject, name)
    made = expand(paths.SCENE_CHUNK, subject=subject, scene=name, chunk=numbers)
    return [*made, *as_built(subject, name)]


def shipped_sequences():
    """The scenes of the five sequences whose recordings are here."""
    return [
        name
        for name in SEQUENCES
        if load_scene(f"config/scenes/{name}.yaml").recording is None
        or load_scene(f"config/scenes/{name}.yaml").frames.exists()
    ]


def figures_of_frames(subject, of):
    """Files of the frames of the five sequences; of: from a name to their pattern."""
    return [
        paths.at(of(f"frames-{name}"), subject=subject) for name in shipped_sequences()
    ]


def levels_against_truth(subject):
    """What the benchmark of levels reads of scanned poses: truth, simulated skin and layers under it."""
    data = whole_dataset(subject)
    poses = [pose for pose in data.poses if pose != data.neutral]
    patterns = [paths.POSE_INNER, paths.POSE_SKIN]
    made = expand(patterns, subject=subject, pose=poses)
    return [*made, *expand(paths.TRUTH, subject=subject, pose=data.poses)]


def compared_with_truth(subject):
    """What a benchmark reads of a built subject to compare it, and its raw scans, with the truth."""
    data = checked(load_dataset, dataset_file(subject))
    of_poses = [
        *(paths.DATA_VOLUME, paths.DATA_SEEDS, paths.DATA_SCAN, paths.TRUTH),
        *(paths.TRUE_BONES, paths.TRUE_MARROW, paths.REGISTRATION),
    ]
    if data.fleshed:
        of_poses.append(paths.POSE_FLESH)
    files = [*of_poses, paths.RIG, paths.HOOKS, paths.metrics_of("skin")]
    return [
        dataset_file(subject),
        *expand(files, subject=subject, pose=data.poses, tendon=data.tendons),
    ]


def creases_beside_models(subject):
    """What the benchmark of level L3 reads of a built subject."""
    files = [
        *(paths.RIG, paths.SKIN, paths.CREASE_TISSUE, paths.TRUTH),
        *(paths.POSE_SKIN, paths.POSE_PASSIVE_SKIN),
    ]
    return [
        dataset_file(subject),
        *expand(files, subject=subject, pose=scanned(subject)),
    ]
