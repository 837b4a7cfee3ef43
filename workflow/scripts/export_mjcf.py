"""The skeleton with the tendons of a scene's frames as a model of MuJoCo, and how near it is to them."""

from common import inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.views.export_mjcf import Inputs, Outputs, export_mjcf

    export_mjcf(inputs_of(snakemake, Inputs), outputs_of(snakemake, Outputs))
