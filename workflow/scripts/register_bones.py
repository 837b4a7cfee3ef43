"""Rigid registration of every bone's neutral marrow into one pose, from the root outwards."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.skeleton.bones import read_surfaces
    from handpipe.skeleton.pose_registration import register_pose, unmoved
    from handpipe.skeleton.registration_result import write_registrations

    dataset = dataset_of(snakemake)
    neutral, target = (read_surfaces(p, "marrow") for p in (snakemake.input.neutral, snakemake.input.target))
    if snakemake.wildcards.pose == dataset.neutral:
        found = unmoved(neutral)
    else:
        found = register_pose(dataset, neutral, target)
    write_registrations(snakemake.output[0], found, [*snakemake.input])
