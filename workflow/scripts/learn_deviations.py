"""How far a fitted hand is expected to be off, learned from its own scans and fits, without truth."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.deviations.learn_deviations import Inputs, learn_deviations

    learn_deviations(inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake))
