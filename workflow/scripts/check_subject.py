"""A scanned subject's files, before hours are spent on its images."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.images.check_subject import Inputs, check_subject

    check_subject(inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake))
