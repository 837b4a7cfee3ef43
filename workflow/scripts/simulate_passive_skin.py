"""The skin of a scanned pose without plastic strains: the full model without them, and one tissue."""

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.baselines.simulate_passive_skin import Inputs, simulate_passive_skin

    simulate_passive_skin(inputs_of(snakemake, Inputs), output_of(snakemake))
