"""The flesh in one scanned pose, which carries the hooks of tendons and the muscles."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.hand.simulate_flesh import Inputs, simulate_flesh

    simulate_flesh(
        inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake), snakemake.wildcards.pose
    )
