"""The template hand of a generated subject: all organs from the file of curves."""

from common import dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.synthetic.template_hand import Inputs, Outputs, template_hand

    template_hand(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        snakemake.params.edges,
    )
