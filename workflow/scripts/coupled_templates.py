"""What a person would bring to a subject that is made from a coupled body."""

from common import dataset_of, inputs_of, stage

with stage(snakemake):
    from handpipe.stages.synthetic.coupled_templates import Inputs, coupled_templates

    coupled_templates(inputs_of(snakemake, Inputs), dataset_of(snakemake), snakemake.params.order)
