"""Equilibrium of a generated subject's coupled body in one pose."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.synthetic.coupled_pose import Inputs, coupled_pose

    coupled_pose(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        snakemake.wildcards.pose,
        snakemake.params.order,
    )
