"""The full model's skin beside that of its variants, over all scanned poses; their organs; the knuckles."""

from common import costs_of, dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.baselines.evaluate_ablations import Inputs, Outputs, evaluate_ablations

    evaluate_ablations(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        costs_of(snakemake),
    )
