"""Neutral muscles without interpenetration, meshed anew: the bodies that all poses deform."""

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.muscles.separate_neutral import Inputs, separate_neutral

    separate_neutral(inputs_of(snakemake, Inputs), output_of(snakemake), snakemake.params.edge)
