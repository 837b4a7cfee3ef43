"""A tendon's rod in a pose: simulated, then fitted to its dark tube in the image (Zheng 2022 §5.3)."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.tendons.register_tendon import Inputs, register_tendon

    register_tendon(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        snakemake.wildcards.tendon,
        snakemake.wildcards.pose,
    )
