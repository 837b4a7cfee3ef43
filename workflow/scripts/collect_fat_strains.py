"""The fat's strains and nail corrections over the poses, neutral (none) among them."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.tissues.collect_fat_strains import Inputs, collect_fat_strains

    collect_fat_strains(
        inputs_of(snakemake, Inputs),
        output_of(snakemake),
        dataset_of(snakemake),
        snakemake.params.interpolation,
    )
