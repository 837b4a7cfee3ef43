"""A page that moves a learned hand: sliders for its joints, fingertips to drag, organs to switch."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.levels.export_player import Inputs, export_player

    export_player(inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake))
