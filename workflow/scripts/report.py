"""One HTML file with pictures, tables, figures and costs of a subject."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.hand.report import Inputs, report

    report(inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake))
