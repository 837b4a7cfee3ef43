"""The end of a build: fails with the names of failed frames; the next build simulates these again."""

import json
import os

from common import stage

with stage(snakemake):
    from handpipe.artifacts import write_text
    from handpipe.errors import HandpipeError
    from handpipe.hand.frames import read_simulated

    failed = {}
    for path in map(str, snakemake.input.chunks):
        _, failures = read_simulated(path)
        if failures:
            failed[path] = failures
    for path in failed:
        # The next build lacks the chunk and makes it again, from the finished frames that are set aside here.
        os.replace(path, snakemake.params.partial[path])
    if failed:
        named = "; ".join(str(failure) for failures in failed.values() for failure in failures)
        count = sum(map(len, failed.values()))
        raise HandpipeError(
            f"{count} frames were not simulated: {named} "
            "The exports and the report stand without them. Change or remove these frames, or build again"
        )
    write_text(snakemake.output[0], json.dumps({"scenes": snakemake.params.scenes}) + "\n")
