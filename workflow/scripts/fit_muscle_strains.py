"""Plastic strains of a muscle, smooth in space and over poses (Zheng 2022 §4.4, stage 3, Eq. 3)."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.muscles.fit_muscle_strains import Inputs, fit_muscle_strains

    fit_muscle_strains(
        inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake), snakemake.wildcards.muscle
    )
