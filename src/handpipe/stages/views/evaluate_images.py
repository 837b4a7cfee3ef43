"""How alike the moved neutral image and the images of scanned poses are: figures of the whole model."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Metrics, metrics, write_text
from handpipe.stages.costs import stage_cost
from handpipe.stages.files import Files

FIGURES = tuple(
    f"{figure}_{model}"
    for figure in ("correlation", "local_correlation")
    for model in ("layers", "one_tissue", "rigid")
)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    tables: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    metrics: Path
    table: Path


def evaluate_images(inputs: Inputs, outputs: Outputs, costs: Sequence[Path]) -> None:
    """How alike the moved neutral image and the images of scanned poses are: figures of the whole model."""
    rows = [json.loads(path.read_text(encoding="utf-8")) for path in inputs.tables]
    write_text(outputs.table, json.dumps(rows, indent=2))
    found: Metrics = {f"{name}_{row['pose']}": (row[name], "1") for row in rows for name in FIGURES}
    for role in dict.fromkeys(row["role"] for row in rows):
        of_role = [row for row in rows if row["role"] == role]
        found |= {
            f"{role}_{name}_mean": (float(np.mean([r[name] for r in of_role])), "1") for name in FIGURES
        }
        found |= {f"{role}_{name}_min": (min(r[name] for r in of_role), "1") for name in FIGURES}
    found["filled_max"] = (max((row["filled"] for row in rows), default=0.0), "1")
    metrics.write(outputs.metrics, found | stage_cost(costs))
