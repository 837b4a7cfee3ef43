"""A template hand as one body of all tissues, whose joints can open."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.synthetic.coupled_body import Inputs, coupled_body

    coupled_body(inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake))
