"""Templates, tendon curves and nails of a generated subject."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.stages.synthetic.generate_templates import generate_templates

    generate_templates(dataset_of(snakemake))
