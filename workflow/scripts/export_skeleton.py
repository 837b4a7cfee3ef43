"""The skeleton with the tendons of a scene's frames for MuJoCo and OpenSim, and how near it is."""

from common import inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.views.export_skeleton import Inputs, Outputs, export_skeleton

    export_skeleton(inputs_of(snakemake, Inputs), outputs_of(snakemake, Outputs))
