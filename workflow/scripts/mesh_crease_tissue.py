"""One soft tissue with creases between the bones and the skin (Wang 2019 §5)."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.tissues.mesh_crease_tissue import CreaseEdges, Inputs, mesh_crease_tissue

    mesh_crease_tissue(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        CreaseEdges(*snakemake.params.edges),
    )
