"""The neutral scan, with its texture, as a scene's frames move it."""

from common import dataset_of, inputs_of, output_of, scene_of, stage

with stage(snakemake):
    from handpipe.stages.views.export_scan import Inputs, export_scan

    export_scan(
        inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake), scene_of(snakemake)
    )
