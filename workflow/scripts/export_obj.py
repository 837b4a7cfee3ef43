"""A scene's frames as OBJ files, for programs that read nothing else."""

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.hand.export_obj import Inputs, export_obj

    export_obj(inputs_of(snakemake, Inputs), output_of(snakemake))
