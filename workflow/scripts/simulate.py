"""One chunk of a scene's frames, every layer that the scene needs; a failed frame is named and left out."""

import os
from pathlib import Path

# The job's threads are processes.
os.environ.update(dict.fromkeys([name for name in os.environ if name.endswith("_NUM_THREADS")], "1"))

from common import dataset_of, inputs_of, output_of, scene_of, stage

if __name__ == "__main__":  # a process that simulates ahead imports this file under another name
    with stage(snakemake):
        from handpipe.stages.hand.simulate import Chunk, Inputs, simulate

        simulate(
            inputs_of(snakemake, Inputs),
            output_of(snakemake),
            dataset_of(snakemake),
            scene_of(snakemake),
            Chunk(
                int(snakemake.wildcards.chunk),
                Path(snakemake.params.partial),
                {name: snakemake.params[name] for name in ("dataset", "code")},
                snakemake.threads,
            ),
        )
