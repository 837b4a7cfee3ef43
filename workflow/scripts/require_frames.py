"""The end of a build: fails with the names of failed frames; the next build simulates these again."""

import json

from common import stage

with stage(snakemake):
    from handpipe.artifacts import write_text
    from handpipe.errors import HandpipeError
    from handpipe.hand.frames import failures_in

    failed = [str(failure) for chunk in snakemake.input.chunks for failure in failures_in(chunk)]
    if failed:
        raise HandpipeError(
            f"{len(failed)} frames were not simulated: {'; '.join(failed)} "
            "The exports and the report stand without them. Change or remove these frames, or build again"
        )
    write_text(snakemake.output[0], json.dumps({"scenes": snakemake.params.scenes}) + "\n")
