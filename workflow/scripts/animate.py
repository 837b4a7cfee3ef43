"""One chunk of a scene's frames at a learned level; a frame unlike the learned ones is named."""

from common import dataset_of, inputs_of, output_of, scene_of, stage

with stage(snakemake):
    from handpipe.stages.levels.animate import Inputs, animate

    animate(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        scene_of(snakemake),
        int(snakemake.wildcards.chunk),
    )
