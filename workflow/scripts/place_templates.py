"""Templates of muscles and ligaments carried onto the subject's bones (Wang 2021 §6.1)."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.muscles.place_templates import Inputs, place_templates

    place_templates(inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake))
