"""How the bones look in every pose; Dice against truth: whole bones in neutral, marrow elsewhere."""

from common import costs_of, dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.images.evaluate_segmentation import Inputs, evaluate_segmentation

    evaluate_segmentation(
        inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake), costs_of(snakemake)
    )
