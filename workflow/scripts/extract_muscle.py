"""The neutral shape of one muscle, from its placed template and the image (Wang 2021 §5.3 and 5.4)."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.muscles.extract_muscle import Inputs, extract_muscle

    extract_muscle(
        inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake), snakemake.wildcards.muscle
    )
