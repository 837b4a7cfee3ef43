"""The full model's skin beside that of simpler models, over all scanned poses."""

from common import costs_of, dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.baselines.evaluate_baselines import Inputs, Outputs, evaluate_baselines

    evaluate_baselines(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        costs_of(snakemake),
    )
