"""Hooks of a tendon: skinning weights and corrections of poses from registered rods (Zheng 2022 §5.4)."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.tendons.fit_hooks import Inputs, fit_hooks

    fit_hooks(
        inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake), snakemake.wildcards.tendon
    )
