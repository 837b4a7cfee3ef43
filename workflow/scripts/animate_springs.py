"""One chunk of a scene's frames with muscles that bulge and a skin of springs."""

from common import dataset_of, inputs_of, output_of, scene_of, stage

with stage(snakemake):
    from handpipe.stages.levels.animate_springs import Inputs, animate_springs

    animate_springs(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        scene_of(snakemake),
        int(snakemake.wildcards.chunk),
    )
