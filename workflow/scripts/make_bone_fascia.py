"""The cloth around the bones, and the constraint of each of its vertices."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.tissues.make_bone_fascia import Inputs, make_bone_fascia

    make_bone_fascia(
        inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake), snakemake.params.edge
    )
