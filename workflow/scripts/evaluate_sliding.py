"""Checks of bodies that slide on one another by themselves."""

from common import costs_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.sliding.evaluate_sliding import Inputs, evaluate_sliding

    evaluate_sliding(inputs_of(snakemake, Inputs), output_of(snakemake), costs_of(snakemake))
