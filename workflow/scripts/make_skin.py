"""The neutral skin from its scan, with nails and the cut end: for the fat and the soft tissue."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.tissues.make_skin import Inputs, make_skin

    make_skin(
        inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake), snakemake.params.edge
    )
