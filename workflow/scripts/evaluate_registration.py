"""Registered transforms against truth, with their uncertainties and what is in doubt or missing."""

import json

from common import dataset_of, stage
from figures import stage_cost
from truth import bone_errors

with stage(snakemake):
    from handpipe import artifacts, metrics
    from handpipe.skeleton.bones import read_surfaces
    from handpipe.skeleton.registration_result import read_registrations
    from handpipe.skeleton.registration_table import registration_figures, registration_rows

    dataset = dataset_of(snakemake)
    figures = stage_cost(snakemake, "register_bones")
    centroids = {b: s.centroid() for b, s in read_surfaces(snakemake.input.neutral, "whole").items()}
    rows, missing = [], []
    for pose, path in zip(dataset.poses, snakemake.input.registrations, strict=True):
        if pose == dataset.neutral:
            continue
        found = read_registrations(path)
        missing += [(pose, bone) for bone in dataset.bones if bone not in found]
        errors = {}
        if dataset.truth is not None:
            transforms = {bone: r.transform for bone, r in found.items()}
            here = {bone: centroids[bone] for bone in found}
            errors = dict(
                zip(found, zip(*bone_errors(dataset, pose, transforms, here), strict=True), strict=True)
            )
        rows += registration_rows(pose, found, errors)
    metrics.write(snakemake.output.metrics, figures | registration_figures(rows, missing))
    artifacts.write_text(snakemake.output.table, json.dumps(rows, indent=2))
