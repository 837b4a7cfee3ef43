"""A scanned subject's surfaces, marks and attachments, each in its frame, before hours of work on images."""

import json

from common import stage

with stage(snakemake):
    from handpipe import artifacts
    from handpipe.config import load_dataset
    from handpipe.hand.subject import check_frames, check_surfaces

    dataset = load_dataset(snakemake.input.dataset)
    check_surfaces(dataset)
    check_frames(dataset)
    artifacts.write_text(snakemake.output[0], json.dumps({"checked": [*snakemake.input]}, indent=2) + "\n")
