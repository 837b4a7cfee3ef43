"""The cloth around the muscles, and the constraint of each of its vertices."""

from common import inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.tissues.make_muscle_fascia import Inputs, make_muscle_fascia

    make_muscle_fascia(inputs_of(snakemake, Inputs), output_of(snakemake), snakemake.params.edge)
