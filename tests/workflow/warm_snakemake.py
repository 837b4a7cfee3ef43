"""Snakemake's command line, run out of a process that has imported its libraries already.

Tests start it some hundred times, and half of each start is imports. This process imports libraries, and what
the workflow takes from the package under test, once and forks for each call. Calls are lines of JSON, answers
are exit statuses.
"""

import gc
import importlib
import json
import os
import re
import sys
from pathlib import Path

LIBRARIES = (
    "snakemake.cli", "snakemake.dag", "snakemake.report", "snakemake.scheduling.job_scheduler",
    "docutils", "h5py", "igl", "jinja2", "meshio", "nbformat", "nibabel", "nrrd", "numba", "PIL.Image",
    "pydantic", "pydicom", "requests", "rich.console", "scipy.interpolate", "scipy.optimize", "SimpleITK",
    "skimage.measure", "smart_open", "yte",
)  # fmt: skip
WORKFLOW = Path(__file__).parents[2] / "workflow"
FROM_PACKAGE = re.compile(r"^\s*from (handpipe[\w.]*) import (\w.*)$", re.MULTILINE)


def import_all() -> None:
    """Import the libraries, and what the rules import from the package."""
    for name in LIBRARIES:
        importlib.import_module(name)
    for file in WORKFLOW.rglob("*.smk"):
        for module, names in FROM_PACKAGE.findall(file.read_text(encoding="utf-8")):
            face = importlib.import_module(module)
            for name in names.split(","):
                getattr(face, name.split(" as ")[0].strip())


def call(folder: str, arguments: list[str], said: str) -> None:
    """Run Snakemake in a folder and end this process; all that it says goes to the file `said`."""
    os.chdir(folder)
    sys.path[0] = os.getcwd()  # as `python -m snakemake` has it
    out = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for stream in (1, 2):
        os.dup2(out, stream)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    sys.argv = ["snakemake", *arguments]
    sys.modules["snakemake.cli"].main()


def serve() -> None:
    """Answer calls until there are no more."""
    import_all()
    gc.freeze()  # calls need not look through what is imported
    for line in sys.stdin:
        process = os.fork()
        if process == 0:
            call(**json.loads(line))
            sys.exit()
        print(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), flush=True)


if __name__ == "__main__":
    serve()
