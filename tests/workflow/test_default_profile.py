"""The default profile leaves the number of cores to the command line."""

import shutil
import subprocess
import sys
from pathlib import Path

from .running import CHECKOUT, ENVIRONMENT

SNAKEFILE = """
rule all:
    output: "threads.txt"
    threads: 8
    shell: "echo {threads} > {output}"
"""


def test_as_many_cores_are_used_as_are_asked_for(tmp_path: Path) -> None:
    shutil.copytree(CHECKOUT / "profiles", tmp_path / "profiles")
    (tmp_path / "Snakefile").write_text(SNAKEFILE, encoding="utf-8")
    for asked, count in (("-j3", "3"), ("--cores=1", "1")):
        run = [sys.executable, "-m", "snakemake", asked, "--forceall"]
        subprocess.run(run, cwd=tmp_path, env=ENVIRONMENT, check=True, capture_output=True)
        assert (tmp_path / "threads.txt").read_text(encoding="utf-8").strip() == count
