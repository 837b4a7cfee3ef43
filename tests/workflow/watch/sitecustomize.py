"""Records the files of a working copy that a job of the workflow reads and its rule does not declare.

Python imports this module at its start if its folder is in PYTHONPATH. For each job, and for each Python that
its script starts, it writes one JSON file into the folder that the variable WATCHED names.
"""

import atexit
import json
import os
import re
import sys
from pathlib import Path

JOB = "WATCHED_JOB"  # variable that tells the processes of a job of which they are
GIVEN = json.loads(os.environ.get(JOB, "null"))
COPY = Path.cwd() if GIVEN is None else Path(GIVEN["copy"])  # results, configuration and what a person gives
CODE = (COPY / ".snakemake", COPY / "workflow")  # what Snakemake writes, and scripts
READ: set[Path] = set()


def is_code(path: Path) -> bool:
    """Whether rules depend on a file by the digest of their code, or Snakemake wrote it."""
    of_benchmarks = path.is_relative_to(COPY / "benchmarks") and path.suffix in (".py", ".pyc")
    return of_benchmarks or any(path.is_relative_to(folder) for folder in CODE)


def note(path: object) -> None:
    """Remember a file of the working copy that is opened."""
    if isinstance(path, str | bytes | os.PathLike):
        found = Path(os.path.abspath(os.fsdecode(path)))  # without ".."
        if found.is_relative_to(COPY) and not is_code(found):
            READ.add(found.with_name(re.sub(r"^\.\d+\.(?=.)", "", found.name)))  # temporary files of outputs


def hook(event: str, arguments: tuple[object, ...]) -> None:
    """Audit hook of Python: files that Python opens to read, and processes that it starts."""
    if event == "subprocess.Popen" and (job := this_job()) is not None:
        os.environ[JOB] = json.dumps(job)
    if event == "open":
        path, mode, flags = arguments
        reads = "r" in mode or "+" in mode if isinstance(mode, str) else not flags & os.O_WRONLY
        if reads:
            note(path)


def declared(job: object) -> list[str]:
    """Files and folders that a job's rule names: inputs, outputs, log, and paths among parameters."""
    named = [*job.input, *job.output, *job.log]
    for value in job.params:
        values = value if isinstance(value, list | tuple) else [value]
        named += [v for v in values if isinstance(v, str) and v.startswith("results/")]
    return [str(Path(path).absolute()) for path in named]


def this_job() -> dict[str, object] | None:
    """The rule of the job to which this process belongs, what it declares, and where; none at its start."""
    job = getattr(sys.modules["__main__"], "snakemake", None)
    if job is None:
        return GIVEN
    return {"rule": job.rule, "declared": declared(job), "copy": str(COPY)}


def report() -> None:
    """Write what was read without a declaration."""
    if (job := this_job()) is None:
        return
    undeclared = [p for p in READ if p.is_file() and not any(p.is_relative_to(k) for k in job["declared"])]
    content = {"rule": job["rule"], "undeclared": sorted(p.relative_to(COPY).as_posix() for p in undeclared)}
    Path(os.environ["WATCHED"], f"{os.getpid()}.json").write_text(json.dumps(content), encoding="utf-8")


of_job = GIVEN is not None or any("/.snakemake/scripts/" in word for word in sys.orig_argv)
if "WATCHED" in os.environ and of_job:
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
