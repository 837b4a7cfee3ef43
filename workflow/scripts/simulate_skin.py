"""The skin of a scanned pose by three models (Zheng 2022 Table 4): full, no fat strains, one tissue."""

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.tissues.simulate_skin import Inputs, simulate_skin

    simulate_skin(inputs_of(snakemake, Inputs), output_of(snakemake))
