"""Snakemake's command line, run out of a process that has imported its libraries already.

Tests start it some hundred times, and a third of each start is imports of libraries. This process imports
them once and forks for each call; the package under test is not imported before the fork. Calls are lines of
JSON, answers are exit statuses.
"""

import importlib
import json
import os
import sys

LIBRARIES = ("snakemake.cli", "h5py", "numba", "pydantic", "scipy.interpolate", "scipy.optimize", "SimpleITK")


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
    for name in LIBRARIES:
        importlib.import_module(name)
    for line in sys.stdin:
        process = os.fork()
        if process == 0:
            call(**json.loads(line))
            sys.exit()
        print(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), flush=True)


if __name__ == "__main__":
    serve()
