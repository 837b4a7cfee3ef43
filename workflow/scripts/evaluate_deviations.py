"""Stated deviations against true errors in scanned poses: coverage by organ, example and held out."""

from common import dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.deviations.evaluate_deviations import Inputs, Outputs, evaluate_deviations

    evaluate_deviations(inputs_of(snakemake, Inputs), outputs_of(snakemake, Outputs), dataset_of(snakemake))
