"""How many bones a person has to look at after neutral, and proposed seeds against truth."""

from common import costs_of, dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.images.evaluate_seeds import Inputs, evaluate_seeds

    evaluate_seeds(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        snakemake.params.poses,
        costs_of(snakemake),
    )
