"""The template hand of real anatomy, and a list of all that was repaired for it."""

from common import dataset_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.synthetic.zanatomy_hand import Outputs, zanatomy_hand

    zanatomy_hand(outputs_of(snakemake, Outputs), dataset_of(snakemake), snakemake.params.edges)
