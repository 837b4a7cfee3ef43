"""A scene's frames with strains, stresses, fibre stretch and contact pressure, as VTU series."""

from common import dataset_of, inputs_of, output_of, scene_of, stage

with stage(snakemake):
    from handpipe.stages.views.export_mechanics import Inputs, export_mechanics

    export_mechanics(
        inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake), scene_of(snakemake)
    )
