"""Records the files of a working copy that a script of the workflow reads and its rule does not declare.

Python imports this module at its start if its folder is in PYTHONPATH. For each job it writes one JSON file
into the folder that the variable WATCHED names.
"""

import atexit
import json
import os
import re
import sys
from pathlib import Path

COPY = Path.cwd()  # results, configuration and what a person gives
CODE = (COPY / ".snakemake", COPY / "workflow")  # what Snakemake writes, and scripts
READ: set[Path] = set()


def note(path: object) -> None:
    """Remember a file of the working copy that is opened."""
    if isinstance(path, str | bytes | os.PathLike):
        found = Path(os.path.abspath(os.fsdecode(path)))  # without ".."
        if found.is_relative_to(COPY) and not any(found.is_relative_to(folder) for folder in CODE):
            READ.add(found.with_name(re.sub(r"^\.\d+\.(?=.)", "", found.name)))  # temporary files of outputs


def hook(event: str, arguments: tuple[object, ...]) -> None:
    """Audit hook of Python: files that Python opens to read."""
    if event == "open":
        path, mode, flags = arguments
        reads = "r" in mode or "+" in mode if isinstance(mode, str) else not flags & os.O_WRONLY
        if reads:
            note(path)


def declared(job: object) -> list[Path]:
    """Files and folders that a job's rule names: inputs, outputs, log, and paths among parameters."""
    named = [*job.input, *job.output, *job.log]
    for value in job.params:
        values = value if isinstance(value, list | tuple) else [value]
        named += [v for v in values if isinstance(v, str) and v.startswith("results/")]
    return [Path(path).absolute() for path in named]


def report() -> None:
    """Write what was read without a declaration, for the job that this process ran."""
    job = getattr(sys.modules["__main__"], "snakemake", None)
    if job is None:
        return
    known = declared(job)
    undeclared = [p for p in READ if p.is_file() and not any(p.is_relative_to(k) for k in known)]
    content = {"rule": job.rule, "undeclared": sorted(p.relative_to(COPY).as_posix() for p in undeclared)}
    Path(os.environ["WATCHED"], f"{os.getpid()}.json").write_text(json.dumps(content), encoding="utf-8")


if "WATCHED" in os.environ and any("/.snakemake/scripts/" in word for word in sys.orig_argv):
    import h5py

    open_file = h5py.File.__init__

    def open_and_note(self: h5py.File, name: object, mode: str = "r", **options: object) -> None:
        """h5py opens files past Python."""
        if mode != "w":
            note(name)
        open_file(self, name, mode, **options)

    h5py.File.__init__ = open_and_note
    sys.addaudithook(hook)
    atexit.register(report)
