"""What every script does: log to the rule's file, turn errors into one message, hand the job's files on."""

import logging
import os
import sys
from contextlib import contextmanager
from pathlib import Path

os.environ.setdefault("NUMBA_NUM_THREADS", os.environ.get("OMP_NUM_THREADS", "1"))
os.environ.setdefault("LP_NUM_THREADS", "1")  # OpenGL on the processor

from handpipe.core import HandpipeError, artifacts, plain
from handpipe.core.configuration import Dataset, Scene, restored


def dataset_of(job):
    """The fields of the subject's dataset that the rule declares; reading another one raises."""
    return restored(job.params.dataset, Dataset)


def scene_of(job):
    """The fields of the scene that the rule declares; reading another one raises."""
    return restored(job.params.scene, Scene)


def inputs_of(job, record):
    """The job's input files as a record of `handpipe.stages.files`, with the names of the rule."""
    return record.named(dict(job.input.items()))


def outputs_of(job, record):
    """The same of its output files."""
    return record.named(dict(job.output.items()))


def output_of(job):
    """The one output file of the job."""
    [path] = job.output
    return Path(path)


def costs_of(job):
    """The folders of the benchmark files of the rules whose cost the stage reports."""
    return [Path(folder) for folder in job.params.costs]


@contextmanager
def stage(job):
    """Run a script's body: log into the rule's log; an error for people ends it with one message."""
    log = logging.getLogger(job.rule)
    try:
        log_to(job.log[0])
        artifacts.check_inputs(job.input)
        with artifacts.made_by(job.rule, {name: str(value) for name, value in job.params.items()}):
            yield log
    except HandpipeError as error:
        log.error("%s", error)
        end(job, plain(error))
    except Exception as error:
        log.exception("unexpected error in %s", job.rule)
        end(job, f"{plain(error)}. See {job.log[0]}")


def log_to(path):
    """Log into a file; where it cannot be written, as on a full disk, logging is silent."""
    logging.raiseExceptions = False
    logging.basicConfig(
        level=logging.INFO,
        format="%(asctime)s %(levelname)s %(name)s: %(message)s",
        datefmt="%H:%M:%S",
        handlers=[logging.FileHandler(path, mode="w")],
        force=True,
    )


def end(job, message):
    """End the script with one message, without a traceback."""
    print(f"handpipe: {job.rule}: {message}", file=sys.stderr)
    sys.exit(1)
