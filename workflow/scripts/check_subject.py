"""A scanned subject's surfaces and attachments, before hours are spent on its images."""

import json

from common import stage

with stage(snakemake):
    from handpipe import artifacts
    from handpipe.config import load_dataset
    from handpipe.hand.subject import check_surfaces

    check_surfaces(load_dataset(snakemake.input.dataset))
    artifacts.write_text(snakemake.output[0], json.dumps({"checked": [*snakemake.input]}, indent=2) + "\n")
