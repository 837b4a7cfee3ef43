"""One chunk of a scene's frames, every layer that the scene needs; a failed frame is named and left out."""

from pathlib import Path

from common import dataset_of, inputs_of, output_of, scene_of, stage

with stage(snakemake):
    from handpipe.stages.hand.simulate import Inputs, simulate

    simulate(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        scene_of(snakemake),
        int(snakemake.wildcards.chunk),
        Path(snakemake.params.partial),
        {name: snakemake.params[name] for name in ("dataset", "code")},
    )
