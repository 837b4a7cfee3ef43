"""A scanned subject's files, before hours are spent on its images."""

import json

from common import stage

with stage(snakemake):
    from handpipe import artifacts
    from handpipe.config import load_dataset
    from handpipe.hand.subject import check_frames, check_images, check_surfaces

    dataset = load_dataset(snakemake.input.dataset)
    check_surfaces(dataset)
    check_images(dataset)
    check_frames(dataset)
    artifacts.write_text(snakemake.output[0], json.dumps({"checked": [*snakemake.input]}, indent=2) + "\n")
