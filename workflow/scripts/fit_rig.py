"""The kinematic rig from registered bones, and its table of errors."""

import json

from common import stage
from truth import bone_errors

with stage(snakemake):
    from handpipe import artifacts, metrics
    from handpipe.config import Role, load_dataset
    from handpipe.skeleton.bones import read_registration, read_surfaces
    from handpipe.skeleton.rig import Rig
    from handpipe.skeleton.table import joint_table

    dataset = load_dataset(snakemake.input.dataset)
    transforms = dict(zip(dataset.poses, map(read_registration, snakemake.input.registrations), strict=True))
    fit_poses = dataset.poses_of(Role.neutral, Role.example)
    figures = {}
    with metrics.measured(figures):
        rig = Rig.fit(dataset, transforms, read_surfaces(snakemake.input.neutral, "whole"), fit_poses)
        table = joint_table(rig, dataset, transforms, fit_poses)
    if dataset.truth is not None:
        centroids = {bone: surface.centroid() for bone, surface in rig.surfaces.items()}
        for role, prefix in ((Role.example, "true_"), (Role.heldout, "true_heldout_")):
            rotations, translations = [], []
            for pose in dataset.poses_of(role):
                found = rig.bone_transforms(rig.poses[pose].angles, rig.poses[pose].root)
                angles, distances = bone_errors(dataset, pose, found, centroids)
                rotations += angles
                translations += distances
            if rotations:
                figures |= metrics.summary(f"{prefix}rotation_error", rotations, "deg")
                figures |= metrics.summary(f"{prefix}translation_error", translations, "mm")
    rig.save(snakemake.output.rig, [*snakemake.input])
    artifacts.write_text(snakemake.output.table, json.dumps(table.rows, indent=2))
    metrics.write(snakemake.output.metrics, table.metrics | figures)
