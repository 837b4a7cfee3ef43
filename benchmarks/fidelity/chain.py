"""The finger's soft tissue at one fidelity: a build in a folder of its own that goes on where it was stopped.

Bones do not depend on the fidelity: they are copied from the finger that is built already.
"""

from __future__ import annotations

import logging
import shutil
from pathlib import Path

from benchmarks.trust.kills import started, working_copy
from handpipe.core import Metrics, metrics
from handpipe.develop.tables import layer_seconds

log = logging.getLogger(__name__)

SUBJECT, SCENE = "phantom-finger", "flexion"
# Settings by the name of a point, as `--config` takes them.
POINTS = {
    "preview": ("fidelity=preview",),
    "standard": ("fidelity=standard",),
    "paper-fat": ("fidelity=standard", "edges={skin: 1.3, fat: 1.7}"),
    "paper": ("fidelity=paper",),
}
OF_BONES = ("data", "segmentation", "registration", "rig.h5")
ERRORS = {
    "skin": ("true_example_error_mean", "true_heldout_error_mean", "true_heldout_error_max"),
    "muscles": ("surface_error_mean", "heldout_surface_error_mean"),
    "tendons": ("centreline_error_mean", "heldout_centreline_error_mean"),
}


def measure(point: str, results: Path) -> Metrics:
    """Errors, seconds a frame and seconds of the fit, each named by the point; `results` has the finger."""
    folder = prepared(results / "benchmarks" / "fidelity" / point, results / SUBJECT)
    targets = [f"results/{SUBJECT}/metrics/{stage}.json" for stage in (*ERRORS, f"frames-{SCENE}")]
    config = ("--config", f"subjects=[{SUBJECT}]", f"scenes=[{SCENE}]", *POINTS[point])
    arguments = ("-j1", "--rerun-incomplete", "--keep-going", *targets, *config)
    if started(folder, arguments).wait() != 0:
        log.warning("%s: the build did not end well; see %s/build.log", point, folder)
    return {f"{point}_{name}": value for name, value in figures(folder / "results" / SUBJECT).items()}


def prepared(folder: Path, finger: Path) -> Path:
    """The folder of a point, with the workflow as it is now, and bones where it has none yet."""
    for part in ("workflow", "config", "profiles"):
        shutil.rmtree(folder / part, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    subject = working_copy(folder) / "results" / SUBJECT
    for part in OF_BONES:
        if not (subject / part).exists():
            copy = shutil.copytree if (finger / part).is_dir() else shutil.copy2
            subject.mkdir(parents=True, exist_ok=True)
            copy(finger / part, subject / part)
    return folder


def figures(subject: Path) -> Metrics:
    """What a built subject's metrics and logs tell of errors and seconds; stages that failed are missing."""
    found: Metrics = {}
    for stage, names in ERRORS.items():
        path = subject / "metrics" / f"{stage}.json"
        known = metrics.read(path) if path.exists() else {}
        found |= {f"{stage}_{name}": known[name] for name in names if name in known}
        if "seconds" in known:
            found[f"{stage}_fit_seconds"] = known["seconds"]
    seconds = [sum(layers.values()) for layers in layer_seconds(subject / "logs/simulate" / SCENE).values()]
    if seconds:
        found["frame_seconds_mean"] = (sum(seconds) / len(seconds), "s")
        found["frame_seconds_max"] = (max(seconds), "s")
    return found
