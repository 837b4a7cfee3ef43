"""Templates, tendon curves and nails of a generated subject."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.datasets import generators

    dataset = dataset_of(snakemake)
    generators.of(dataset).generate_templates(dataset)
