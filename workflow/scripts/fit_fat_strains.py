"""Nail corrections and plastic strains of the fat in one example pose (Zheng 2022 §7.2 and 7.3)."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.tissues.fit_fat_strains import Inputs, fit_fat_strains

    fit_fat_strains(inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake))
