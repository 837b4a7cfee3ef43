"""A scene's frames as a skeleton with skinned bodies and corrective shapes, for riggers."""

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.views.export_rigged import Inputs, export_rigged

    export_rigged(inputs_of(snakemake, Inputs), output_of(snakemake))
