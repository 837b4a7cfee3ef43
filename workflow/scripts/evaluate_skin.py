"""Distances of scans from simulated skins (Zheng 2022 Table 4), and of these from the true skin."""

from common import costs_of, dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.tissues.evaluate_skin import Inputs, Outputs, evaluate_skin

    evaluate_skin(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        costs_of(snakemake),
    )
