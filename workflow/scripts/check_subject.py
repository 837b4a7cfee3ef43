"""A scanned subject's surfaces and attachments, before hours are spent on its images."""

import json

from common import dataset_of, stage

with stage(snakemake):
    from handpipe import artifacts
    from handpipe.hand.subject import check_surfaces

    check_surfaces(dataset_of(snakemake))
    artifacts.write_text(snakemake.output[0], json.dumps({"checked": [*snakemake.input]}, indent=2) + "\n")
