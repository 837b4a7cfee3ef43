"""Figures of a benchmark, measured in a process that has its threads from its start."""

import subprocess
import sys

from common import stage

with stage(snakemake) as log:
    from handpipe.core import HandpipeError

    # With -j1 Snakemake counts one thread; a benchmark takes its own two all the same.
    command = [sys.executable, "-m", f"benchmarks.{snakemake.params.name}", *snakemake.params.arguments]
    command += ["--output", snakemake.output[0]]
    log.info("%s", " ".join(command))
    with open(snakemake.log[0], "a", encoding="utf-8") as file:
        code = subprocess.run(command, stdout=file, stderr=file, check=False).returncode
    if code != 0:
        raise HandpipeError(f"the benchmarks ended with code {code}. See {snakemake.log[0]}")
