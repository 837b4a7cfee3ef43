"""Rigid registration of every bone's neutral marrow into one pose, from the root outwards."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.skeleton.register_bones import Inputs, register_bones

    register_bones(
        inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake), snakemake.wildcards.pose
    )
