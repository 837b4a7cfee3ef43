"""Wall-clock time and peak memory of the whole build."""

from pathlib import Path

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.hand.evaluate_build import Inputs, evaluate_build

    evaluate_build(inputs_of(snakemake, Inputs), output_of(snakemake), Path(snakemake.params.jobs))
