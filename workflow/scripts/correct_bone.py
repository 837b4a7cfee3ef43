"""Marrow probability of one bone in one pose, with the scribbles that correct it."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.images.correct_bone import Inputs, correct_bone

    correct_bone(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        snakemake.wildcards.pose,
        snakemake.wildcards.bone,
    )
