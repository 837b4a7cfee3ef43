"""The fat of a variant that differs in what it lies on, or in how it is constrained."""

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.baselines.mesh_ablated_fat import Inputs, mesh_ablated_fat

    mesh_ablated_fat(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        snakemake.params.edge,
        snakemake.wildcards.variant,
    )
