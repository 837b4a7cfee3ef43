"""A scanned subject's files, before hours are spent on its images."""

import json

from common import dataset_of, stage

with stage(snakemake):
    from handpipe import artifacts
    from handpipe.hand.subject import check_frames, check_images, check_surfaces

    dataset = dataset_of(snakemake)
    check_surfaces(dataset)
    check_images(dataset)
    check_frames(dataset)
    artifacts.write_text(snakemake.output[0], json.dumps({"checked": [*snakemake.input]}, indent=2) + "\n")
