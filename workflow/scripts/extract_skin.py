"""The skin of a pose without a scan, from its volume: it takes the scan's place."""

from common import dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.tissues.extract_skin import Inputs, Outputs, extract_skin

    extract_skin(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        snakemake.wildcards.pose,
    )
