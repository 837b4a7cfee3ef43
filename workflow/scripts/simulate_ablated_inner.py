"""All layers under the fat in one scanned pose, as a variant of the full model has them."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.baselines.simulate_ablated_inner import Inputs, simulate_ablated_inner

    simulate_ablated_inner(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        snakemake.wildcards.variant,
    )
