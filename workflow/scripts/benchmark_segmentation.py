"""Figures of the random walker and scikit-image's, measured in a process with one thread from its start."""

import subprocess
import sys

from common import stage

with stage(snakemake) as log:
    from handpipe.errors import HandpipeError

    command = [sys.executable, "-m", "benchmarks.segmentation", snakemake.input.dataset]
    command += ["--output", snakemake.output[0], "--poses", *snakemake.params.poses]
    log.info("%s", " ".join(command))
    with open(snakemake.log[0], "a", encoding="utf-8") as file:
        code = subprocess.run(command, stdout=file, stderr=file, check=False).returncode
    if code != 0:
        raise HandpipeError(f"the benchmark ended with code {code}. See {snakemake.log[0]}")
