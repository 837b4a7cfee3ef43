"""The kinematic rig from registered bones, its table of errors, and the limits of its angles."""

from common import dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.skeleton.fit_rig import Inputs, Outputs, fit_rig

    fit_rig(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        snakemake.params.organs,
    )
