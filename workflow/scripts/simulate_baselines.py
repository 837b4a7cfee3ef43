"""The skin of a scanned pose by simpler models than those of Zheng 2022 Table 4."""

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.baselines.simulate_baselines import Inputs, simulate_baselines

    simulate_baselines(inputs_of(snakemake, Inputs), output_of(snakemake))
