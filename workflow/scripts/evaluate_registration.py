"""Registered transforms against truth."""

from common import stage
from figures import stage_cost
from truth import bone_errors

with stage(snakemake):
    from handpipe import metrics
    from handpipe.config import load_dataset
    from handpipe.skeleton.bones import read_registration, read_surfaces

    dataset = load_dataset(snakemake.input.dataset)
    figures = stage_cost(snakemake, "register_bones")
    centroids = {b: s.centroid() for b, s in read_surfaces(snakemake.input.neutral, "whole").items()}
    rotations, translations = [], []
    for pose, path in zip(dataset.poses, snakemake.input.registrations, strict=True):
        if dataset.truth is None or pose == dataset.neutral:
            continue
        angles, distances = bone_errors(dataset, pose, read_registration(path), centroids)
        rotations += angles
        translations += distances
    if rotations:
        figures |= metrics.summary("rotation_error", rotations, "deg")
        figures |= metrics.summary("translation_error", translations, "mm")
    metrics.write(snakemake.output[0], figures)
