"""The moved neutral image of a scene as two movies of volumes: all anatomy, and fat alone."""

from common import dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.views.render_volumes import Inputs, Outputs, render_volumes

    render_volumes(inputs_of(snakemake, Inputs), outputs_of(snakemake, Outputs), dataset_of(snakemake))
