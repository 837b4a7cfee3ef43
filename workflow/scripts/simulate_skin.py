"""The skin of one scanned pose by three models (000 Table 4): full, without fat strains, one soft tissue."""

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.tissues.simulate_skin import Inputs, simulate_skin

    simulate_skin(inputs_of(snakemake, Inputs), output_of(snakemake))
