"""How alike the moved neutral image and the images of scanned poses are: figures of the whole model."""

from common import costs_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.views.evaluate_images import Inputs, Outputs, evaluate_images

    evaluate_images(inputs_of(snakemake, Inputs), outputs_of(snakemake, Outputs), costs_of(snakemake))
