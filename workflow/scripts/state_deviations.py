"""Stated deviations of a scene's frames: an artifact beside them, and VTU series that carry them."""

from common import inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.deviations.state_deviations import Inputs, Outputs, state_deviations

    state_deviations(inputs_of(snakemake, Inputs), outputs_of(snakemake, Outputs))
