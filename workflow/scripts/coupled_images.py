"""Volume, scan, truth and label volumes of one pose of a coupled body."""

from common import dataset_of, inputs_of, stage

with stage(snakemake):
    from handpipe.stages.synthetic.coupled_images import Inputs, coupled_images

    coupled_images(
        inputs_of(snakemake, Inputs), dataset_of(snakemake), snakemake.wildcards.pose, snakemake.params.order
    )
