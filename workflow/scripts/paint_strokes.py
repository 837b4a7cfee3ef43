"""The strokes on a real limb's image as a label volume on its grid."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.images.paint_strokes import Inputs, paint_strokes

    paint_strokes(inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake))
