"""A ligament: its placed template as an elastic body on its bones (Zheng 2022 §4.1)."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.muscles.fit_ligament import Inputs, fit_ligament

    fit_ligament(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        snakemake.wildcards.ligament,
    )
