"""Checks of a coupled body by itself: patch test, volumes, inverted tets, skin that cuts itself."""

from common import costs_of, dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.synthetic.evaluate_truth import Inputs, evaluate_truth

    evaluate_truth(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        snakemake.params.order,
        costs_of(snakemake),
    )
