"""The figures that a stage measured on itself: a flat map name -> {value, unit} in JSON."""

from __future__ import annotations

import json
import resource
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from handpipe.core.artifacts import write_text

Metrics = dict[str, tuple[float, str]]


@contextmanager
def measured(metrics: Metrics) -> Iterator[Metrics]:
    """Add the time of the block and the peak memory of this process to metrics.

    Parameters
    ----------
    metrics : dict
        Metrics to which `seconds` in s and `peak_memory` in GiB are added after the block.

    Yields
    ------
    dict
        The same metrics.
    """
    start = time.perf_counter()
    yield metrics
    metrics["seconds"] = (time.perf_counter() - start, "s")
    metrics["peak_memory"] = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20, "GiB")


def summary(name: str, errors: object, unit: str) -> Metrics:
    """`name_mean`, `name_median` and `name_max` of an array of errors.

    Parameters
    ----------
    name : str
        Prefix of the three metrics.
    errors : array_like
        Errors of any shape, in `unit`.
    unit : str
        Unit of the errors, such as "mm".

    Returns
    -------
    dict of str to (float, str)
        Values and units by name.

    Examples
    --------
    >>> summary("surface_error", [0.1, 0.2, 0.6], "mm")["surface_error_max"]
    (0.6, 'mm')
    """
    import numpy as np

    e = np.asarray(errors, dtype=float)
    return {
        f"{name}_mean": (float(e.mean()), unit),
        f"{name}_median": (float(np.median(e)), unit),
        f"{name}_max": (float(e.max()), unit),
    }


def write(path: str | Path, metrics: Mapping[str, tuple[float, str]]) -> None:
    """Write metrics as JSON, sorted by name."""
    flat = {name: {"value": value, "unit": unit} for name, (value, unit) in sorted(metrics.items())}
    write_text(path, json.dumps(flat, indent=2) + "\n")


def read(path: str | Path) -> Metrics:
    """Read what `write` wrote."""
    return {k: (v["value"], v["unit"]) for k, v in json.loads(Path(path).read_text(encoding="utf-8")).items()}
