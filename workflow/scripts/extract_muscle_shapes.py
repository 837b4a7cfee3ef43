"""Shapes of all muscles in the example poses (Zheng 2022 §4.4, stage 1)."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.muscles.extract_muscle_shapes import Inputs, extract_muscle_shapes

    extract_muscle_shapes(inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake))
