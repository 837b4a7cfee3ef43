"""All layers under the fat in one scanned pose."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.hand.simulate_inner import Inputs, simulate_inner

    simulate_inner(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        snakemake.wildcards.pose,
        snakemake.params.layers,
    )
