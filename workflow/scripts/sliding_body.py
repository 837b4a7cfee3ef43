"""The finger's bodies that slide on one another, at rest."""

from common import output_of, stage

with stage(snakemake):
    from handpipe.stages.sliding.sliding_body import sliding_body

    sliding_body(output_of(snakemake))
