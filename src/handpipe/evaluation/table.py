"""Tables of the report: skin errors by pose and model, rig errors by joint, figures by stage."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from handpipe.metrics import Metrics

Array = NDArray[np.float64]
Cell = str | float | None

MODELS = {
    "m0": "m0: full model",
    "m1": "m1: without plastic strains in the fat",
    "m2": "m2: one soft tissue",
}
STATISTICS: dict[str, Callable[[Array], float]] = {
    "mean": lambda e: float(np.mean(e)),
    "median": lambda e: float(np.median(e)),
    "max": lambda e: float(np.max(e)),
}
ALL = "all"


@dataclass(frozen=True)
class Table:
    """Rows under column heads; numbers show `digits` decimals, None is an empty cell."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    note: str = ""
    digits: int = 2

    def html(self) -> str:
        """As an HTML table; every text is escaped."""
        head = "".join(f'<th scope="col">{escape(c)}</th>' for c in self.columns)
        body = "\n".join(self._row(row) for row in self.rows)
        note = f"<small>{escape(self.note)}</small>" if self.note else ""
        caption = f"<caption>{escape(self.title)} {note}</caption>"
        return f"<table>{caption}<thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table>"

    def _row(self, row: Sequence[Cell]) -> str:
        first, *rest = (self._text(cell) for cell in row)
        return f'<tr><th scope="row">{first}</th>' + "".join(f"<td>{cell}</td>" for cell in rest) + "</tr>"

    def _text(self, cell: Cell) -> str:
        if cell is None:
            return ""
        return escape(cell) if isinstance(cell, str) else f"{cell:.{self.digits}f}"


def skin_metrics(distances: Mapping[str, Mapping[str, Array]]) -> Metrics:
    """Metrics `skin_{pose}_{model}_{statistic}` in mm of distances by pose and model ("m0", "m1", "m2").

    The pose "all" holds the mean of the means, the median of the medians and the largest maximum, as does
    Zheng 2022, Table 4; `skin_{pose}_ratio_{statistic}` is m0 / m2 in %.
    """
    metrics: Metrics = {}
    for pose, by_model in distances.items():
        for model, d in by_model.items():
            for name, statistic in STATISTICS.items():
                metrics[f"skin_{pose}_{model}_{name}"] = (statistic(np.asarray(d, float)), "mm")
    for name, statistic in STATISTICS.items():
        for model in dict.fromkeys(m for by_model in distances.values() for m in by_model):
            values = [metrics[f"skin_{p}_{model}_{name}"][0] for p in distances if model in distances[p]]
            metrics[f"skin_{ALL}_{model}_{name}"] = (statistic(np.array(values)), "mm")
        for pose in (*distances, ALL):
            full, single = (metrics.get(f"skin_{pose}_{model}_{name}") for model in ("m0", "m2"))
            if full and single and single[0] > 0:
                metrics[f"skin_{pose}_ratio_{name}"] = (100 * full[0] / single[0], "%")
    return metrics


def skin_table(metrics: Metrics, roles: Mapping[str, str]) -> Table | None:
    """Table 4 of Zheng 2022 from `skin_metrics`, rows by `roles` (pose -> role); None without figures."""
    models = [m for m in MODELS if any(f"skin_{p}_{m}_mean" in metrics for p in roles)]
    if not models:
        return None
    columns = [c for c in (*models, "ratio") if c != "ratio" or {"m0", "m2"} <= set(models)]
    keys = [(name, column) for name in STATISTICS for column in columns]
    rows: list[list[Cell]] = []
    for pose in (*roles, ALL):
        found = [metrics.get(f"skin_{pose}_{column}_{name}") for name, column in keys]
        if any(found):
            label = pose if pose == ALL else f"{pose} ({roles[pose]})"
            rows.append([label, *(None if f is None else f[0] for f in found)])
    heads = [f"{name} {'m0/m2 [%]' if column == 'ratio' else column + ' [mm]'}" for name, column in keys]
    note = "Distance of each vertex of the scanned skin to the simulated skin. " + "; ".join(
        MODELS[m] for m in models
    )
    return Table("Simulated against scanned skin (Zheng 2022, Table 4).", ["pose", *heads], rows, note)


@dataclass(frozen=True)
class JointErrors:
    """Mean errors of one joint over the poses, rotations in degrees, translations in mm.

    "full" is the model with residual functions, "partial" without.
    """

    full_rotation: float
    partial_rotation: float
    full_translation: float
    partial_translation: float


RIG_COLUMNS = {
    "full_rotation": ("FM_R [deg]", "deg"),
    "partial_rotation": ("PM_R [deg]", "deg"),
    "full_translation": ("FM_x [mm]", "mm"),
    "partial_translation": ("PM_x [mm]", "mm"),
}


def rig_metrics(errors: Mapping[str, JointErrors]) -> Metrics:
    """Metrics `{joint}_{full,partial}_{rotation,translation}` and their means under the joint "average"."""
    metrics: Metrics = {}
    for column, (_, unit) in RIG_COLUMNS.items():
        values = {joint: float(getattr(e, column)) for joint, e in errors.items()}
        metrics |= {f"{joint}_{column}": (value, unit) for joint, value in values.items()}
        metrics[f"average_{column}"] = (float(np.mean(list(values.values()))), unit)
    return metrics


def rig_table(metrics: Metrics) -> Table | None:
    """Table 1 of Wang 2019 from `rig_metrics`; None without figures."""
    suffix = "_full_rotation"
    joints = [name.removesuffix(suffix) for name in metrics if name.endswith(suffix)]
    joints = [j for j in joints if j != "average"] + [j for j in joints if j == "average"]
    if not joints:
        return None
    rows = [[j, *(metrics.get(f"{j}_{c}", (None, ""))[0] for c in RIG_COLUMNS)] for j in joints]
    note = "Rig against registered bones. FM: full model; PM: without residual rotations and translations."
    return Table(
        "Bone rig errors (Wang 2019, Table 1).", ["joint", *(h for h, _ in RIG_COLUMNS.values())], rows, note
    )


def metrics_table(title: str, metrics: Metrics, poses: Sequence[str]) -> Table:
    """All figures of a stage: a row per measure, a column per pose that the metrics' names hold."""
    values: dict[tuple[str, str], dict[str, float]] = {}
    for name, (value, unit) in metrics.items():
        measure, pose = _split(name, poses)
        values.setdefault((measure, unit), {})[pose] = value
    used = [p for p in ("", *poses) if any(p in row for row in values.values())]
    rows: list[list[Cell]] = [
        [measure, unit, *(_short(row.get(p)) for p in used)] for (measure, unit), row in values.items()
    ]
    return Table(title, ["measure", "unit", *(p or "overall" for p in used)], rows)


def _split(name: str, poses: Sequence[str]) -> tuple[str, str]:
    words = name.replace(".", "_").replace("/", "_").split("_")
    pose = next((p for p in poses if p in words), "")
    return " ".join(w for w in words if w != pose), pose


def _short(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
