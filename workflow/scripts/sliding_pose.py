"""Equilibrium of bodies that slide on one another in one pose."""

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.sliding.sliding_pose import Inputs, sliding_pose

    sliding_pose(inputs_of(snakemake, Inputs), output_of(snakemake), snakemake.wildcards.pose)
