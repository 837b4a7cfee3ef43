"""The index of a training set, and what its frames share."""

from common import dataset_of, inputs_of, outputs_of, scene_of, stage

with stage(snakemake):
    from handpipe.stages.levels.index_shards import Inputs, Outputs, index_shards

    index_shards(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        scene_of(snakemake),
        snakemake.wildcards.scene,
    )
