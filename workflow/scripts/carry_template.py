"""Axis hints, tendons' paths and nails of a template, carried onto the subject's neutral bones."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.skeleton.carry_template import Inputs, carry_template

    carry_template(inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake))
