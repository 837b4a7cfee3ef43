"""Distances from each scan to the simulated skins (000 Table 4), and from these to the true skin."""

from common import costs_of, dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.tissues.evaluate_skin import Inputs, Outputs, evaluate_skin

    evaluate_skin(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        costs_of(snakemake),
    )
