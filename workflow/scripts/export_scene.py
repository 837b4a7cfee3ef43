"""A scene's frames for other programs: VTU series with .pvd, and glTF with the motion."""

from common import inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.hand.export_scene import Inputs, Outputs, export_scene

    export_scene(inputs_of(snakemake, Inputs), outputs_of(snakemake, Outputs))
