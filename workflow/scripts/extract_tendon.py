"""A tendon's neutral rod and tube from the volume and a clicked curve."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.tendons.extract_tendon import Inputs, extract_tendon

    extract_tendon(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        snakemake.wildcards.tendon,
        snakemake.params.edge,
    )
