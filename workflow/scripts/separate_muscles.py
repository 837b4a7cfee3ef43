"""Muscles of an example pose without interpenetration (Zheng 2022 §4.4, stage 2)."""

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.muscles.separate_muscles import Inputs, separate_muscles

    separate_muscles(inputs_of(snakemake, Inputs), output_of(snakemake), snakemake.wildcards.pose)
