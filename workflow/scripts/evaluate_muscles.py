"""Simulated muscles against truth; penetration after separation; inverted tets."""

from common import costs_of, dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.muscles.evaluate_muscles import Inputs, Outputs, evaluate_muscles

    evaluate_muscles(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        costs_of(snakemake),
    )
