"""Labels of a pose without conflicts between bones, and the bones' surfaces."""

from common import dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.images.merge_labels import Inputs, Outputs, merge_labels

    merge_labels(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        snakemake.wildcards.pose,
    )
