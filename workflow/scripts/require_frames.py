"""The end of a build: fails with the names of failed frames; the next build simulates these again."""

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.hand.require_frames import Inputs, require_frames

    require_frames(inputs_of(snakemake, Inputs), output_of(snakemake), snakemake.params.scenes)
