"""Seeds of one pose of a generated subject, drawn into its true bones."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.stages.synthetic.generate_seeds import generate_seeds

    generate_seeds(dataset_of(snakemake), snakemake.wildcards.pose)
