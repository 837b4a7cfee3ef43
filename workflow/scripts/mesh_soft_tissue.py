"""One soft tissue between the bones and the skin (Wang 2019 §5)."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.tissues.mesh_soft_tissue import Inputs, mesh_soft_tissue

    mesh_soft_tissue(
        inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake), snakemake.params.edge
    )
