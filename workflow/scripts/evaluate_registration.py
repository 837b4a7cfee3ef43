"""Registered transforms against truth, with their uncertainties and what is in doubt or missing."""

from common import costs_of, dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.skeleton.evaluate_registration import Inputs, Outputs, evaluate_registration

    evaluate_registration(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        costs_of(snakemake),
    )
