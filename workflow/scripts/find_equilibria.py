"""Whether the frames of a chunk have other equilibria: their fat or soft tissue from other starts."""

from common import dataset_of, inputs_of, output_of, scene_of, stage

with stage(snakemake):
    from handpipe.stages.views.find_equilibria import Inputs, find_equilibria

    find_equilibria(
        inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake), scene_of(snakemake)
    )
