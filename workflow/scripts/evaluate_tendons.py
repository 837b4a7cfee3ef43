"""Simulated tendons against truth, in example and held-out poses."""

from common import costs_of, dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.tendons.evaluate_tendons import Inputs, evaluate_tendons

    evaluate_tendons(
        inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake), costs_of(snakemake)
    )
