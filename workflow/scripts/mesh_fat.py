"""The fat: tetrahedra between the neutral inner layers and the skin, and what holds them."""

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.tissues.mesh_fat import Inputs, mesh_fat

    mesh_fat(inputs_of(snakemake, Inputs), output_of(snakemake), snakemake.params.edge)
