"""Registered transforms against truth."""

from common import stage
from figures import stage_cost

with stage(snakemake):
    import numpy as np

    from handpipe import artifacts, metrics
    from handpipe.config import load_dataset
    from handpipe.mesh.rigid import RigidTransform
    from handpipe.skeleton.bones import read_registration, read_surfaces

    dataset = load_dataset(snakemake.input.dataset)
    figures = stage_cost(snakemake, "register_bones")
    centroids = {b: s.centroid() for b, s in read_surfaces(snakemake.input.neutral, "whole").items()}
    rotations, translations = [], []
    for pose, path in zip(dataset.poses, snakemake.input.registrations, strict=True):
        if dataset.truth is None or pose == dataset.neutral:
            continue
        truth = artifacts.read(dataset.path(dataset.truth.folder) / f"{pose}.h5", "truth")["bones"]
        for bone, found in read_registration(path).items():
            true = RigidTransform(truth[bone]["rotation"], truth[bone]["translation"])
            rotations.append(np.degrees(found.angle_to(true)))
            translations.append(np.linalg.norm(found(centroids[bone][None]) - true(centroids[bone][None])))
    if rotations:
        figures |= metrics.summary("rotation_error", rotations, "deg")
        figures |= metrics.summary("translation_error", translations, "mm")
    metrics.write(snakemake.output[0], figures)
