"""A subject that `init` wrote, built by the stages of the workflow without Snakemake."""

from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.skeleton.rig import Rig
from handpipe.stages.images import merge_labels, propose_seeds, segment_pose
from handpipe.stages.skeleton import fit_rig, register_bones


def to_the_rig(dataset: Dataset, folder: Path) -> Rig:
    """The workflow's stages in its order, without Snakemake; strokes of neutral alone."""

    def file(pose: str, name: str) -> Path:
        (folder / pose).mkdir(parents=True, exist_ok=True)
        return folder / pose / name

    neutral = dataset.neutral
    for pose in (neutral, *dataset.examples):
        volume, drawn = dataset.path(dataset.poses[pose].volume), dataset.poses[pose].seeds
        path = file(pose, "seeds.nii.gz") if drawn is None else dataset.path(drawn)
        if drawn is None:
            given = propose_seeds.Inputs(volume, file(neutral, "surfaces.h5"))
            found = propose_seeds.Outputs(path, file(pose, "seeds.json"), file(pose, "located.h5"))
            propose_seeds.propose_seeds(given, found, dataset, pose)
        claims = file(pose, "bones.h5")
        segment_pose.segment_pose(segment_pose.Inputs(volume, path), claims, dataset, pose, ())
        looks = None if pose == neutral else file(neutral, "looks.json")
        names = ("labels.nii.gz", "labels.json", "surfaces.h5", "looks.json")
        merge_labels.merge_labels(
            merge_labels.Inputs(volume, path, claims, (), (), looks),
            merge_labels.Outputs(*(file(pose, name) for name in names)),
            dataset,
            pose,
        )
        surfaces = register_bones.Inputs(file(neutral, "surfaces.h5"), file(pose, "surfaces.h5"))
        register_bones.register_bones(surfaces, file(pose, "moved.h5"), dataset, pose)
    return rig_of(dataset, folder)


def rig_of(dataset: Dataset, folder: Path) -> Rig:
    """The rig of registered bones, written beside them."""
    moved = [folder / pose / "moved.h5" for pose in dataset.poses]
    outputs = fit_rig.Outputs(
        *(folder / name for name in ("rig.h5", "rig.json", "table.json", "limits.json"))
    )
    inputs = fit_rig.Inputs(folder / dataset.neutral / "surfaces.h5", moved, ())
    fit_rig.fit_rig(inputs, outputs, dataset, False)
    return Rig.load(outputs.rig)
