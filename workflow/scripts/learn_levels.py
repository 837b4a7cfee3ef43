"""Weights and correctives from the frames of a scene, with their errors on left-out frames."""

from common import inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.levels.learn_levels import Inputs, Outputs, learn_levels

    learn_levels(inputs_of(snakemake, Inputs), outputs_of(snakemake, Outputs))
