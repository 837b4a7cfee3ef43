"""Marrow probability of every bone in one pose, each in a region around its seeds."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.images.segment_pose import Inputs, segment_pose

    segment_pose(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        snakemake.wildcards.pose,
        snakemake.params.scribbled,
    )
