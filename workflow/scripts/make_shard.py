"""One chunk of a scene of random poses as a shard of a training set; failed frames are recorded."""

from common import dataset_of, inputs_of, output_of, scene_of, stage

with stage(snakemake):
    from handpipe.stages.levels.make_shard import Inputs, make_shard

    make_shard(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        scene_of(snakemake),
        int(snakemake.wildcards.chunk),
    )
