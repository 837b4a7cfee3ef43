"""The skin of a scanned pose by a variant of the full model, with and without strains of the fat."""

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.baselines.simulate_ablated_skin import Inputs, simulate_ablated_skin

    simulate_ablated_skin(inputs_of(snakemake, Inputs), output_of(snakemake), snakemake.wildcards.variant)
