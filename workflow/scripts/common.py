"""What every script does: log to the rule's file, turn errors into one message."""

import logging
import os
import sys
from contextlib import contextmanager

os.environ.setdefault("NUMBA_NUM_THREADS", os.environ.get("OMP_NUM_THREADS", "1"))

from handpipe import artifacts
from handpipe.config import Dataset, Scene
from handpipe.errors import HandpipeError, plain
from handpipe.selection import restored


def dataset_of(job):
    """The fields of the subject's dataset that the rule declares; reading another one raises."""
    return restored(job.params.dataset, Dataset)


def scene_of(job):
    """The fields of the scene that the rule declares; reading another one raises."""
    return restored(job.params.scene, Scene)


@contextmanager
def stage(job):
    """Run a script's body: log into the rule's log; an error for people ends it with one message."""
    logging.basicConfig(
        level=logging.INFO,
        format="%(asctime)s %(levelname)s %(name)s: %(message)s",
        datefmt="%H:%M:%S",
        handlers=[logging.FileHandler(job.log[0], mode="w")],
        force=True,
    )
    log = logging.getLogger(job.rule)
    try:
        artifacts.check_inputs(job.input)
        with artifacts.made_by(job.rule, {name: str(value) for name, value in job.params.items()}):
            yield log
    except HandpipeError as error:
        log.error("%s", error)
        end(job, plain(error))
    except Exception as error:
        log.exception("unexpected error in %s", job.rule)
        end(job, f"{plain(error)}. See {job.log[0]}")


def end(job, message):
    """End the script with one message, without a traceback."""
    print(f"handpipe: {job.rule}: {message}", file=sys.stderr)
    sys.exit(1)
