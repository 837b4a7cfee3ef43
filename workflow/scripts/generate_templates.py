"""Templates, tendon curves and nails of a generated subject."""

from common import stage

with stage(snakemake):
    from handpipe.config import load_dataset
    from handpipe.datasets import generators

    dataset = load_dataset(snakemake.input.dataset)
    generators.of(dataset).generate_templates(dataset)
