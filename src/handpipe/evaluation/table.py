"""Tables of the report.

They give errors of skin by pose and model, of muscles by pose, of the rig by joint, and figures by stage.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from handpipe.core import Array, Metrics

Cell = str | float | None
Row = Mapping[str, str | float]

SKIN_MODELS = {  # the first three are those of Zheng 2022 Table 4
    "m0": "m0: full model",
    "m1": "m1: without plastic strains in the fat",
    "m2": "m2: one soft tissue",
    "m3": "m3: one soft tissue with plastic strains (Ichim 2017)",
    "dual_quaternion": "skinning by dual quaternions",
    "linear": "linear skinning",
    "pivot": "dual quaternions on a pivot rig",
}

STATISTICS: dict[str, Callable[[Array], float]] = {
    "mean": lambda e: float(np.mean(e)),
    "median": lambda e: float(np.median(e)),
    "max": lambda e: float(np.max(e)),
}
ALL = "all"
ALIKE = 0.005  # two numbers differ if they differ by more, relative to the larger one
MOST_DIGITS = 6  # decimals


@dataclass(frozen=True)
class Table:
    """Rows under column heads.

    Parameters
    ----------
    title : str
        Caption.
    columns : sequence of str
        Column heads.
    rows : sequence of sequence of Cell
        Cells; None is an empty cell.
    note : str
        Smaller text in the caption.
    digits : int
        Least decimals of numbers. Columns of a unit have more where different numbers would read the same.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    note: str = ""
    digits: int = 2

    def html(self) -> str:
        """As an HTML table; every text is escaped."""
        head = "".join(f'<th scope="col">{escape(c)}</th>' for c in self.columns)
        digits = self.decimals()
        body = "\n".join(_row([_text(c, d) for c, d in zip(row, digits, strict=True)]) for row in self.rows)
        note = f"<small>{escape(self.note)}</small>" if self.note else ""
        caption = f"<caption>{escape(self.title)} {note}</caption>"
        return f"<table>{caption}<thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table>"

    def decimals(self) -> list[int]:
        """Decimals of each column, with which numbers that differ in a column or a row read differently.

        Returns
        -------
        list of int
            A number a column, the same for columns of one unit. Numbers that are equal but for 0.5 % may read
            the same.
        """
        digits = [self.digits] * len(self.columns)
        columns = [[_number(row[i]) for row in self.rows] for i in range(len(self.columns))]
        for i, column in enumerate(columns):
            while digits[i] < MOST_DIGITS and _alike(column, [digits[i]] * len(column)):
                digits[i] += 1
        rows = [[_number(cell) for cell in row] for row in self.rows]
        while (close := set().union(*(_alike(row, digits) for row in rows))) and min(
            digits[i] for i in close
        ) < MOST_DIGITS:
            digits = [min(d + 1, MOST_DIGITS) if i in close else d for i, d in enumerate(digits)]
        units = [c.rpartition("[")[2] if c.endswith("]") else "" for c in self.columns]
        return [max(d for d, other in zip(digits, units, strict=True) if other == unit) for unit in units]


def _number(cell: Cell) -> float | None:
    return None if cell is None or isinstance(cell, str) else float(cell)


def _alike(numbers: Sequence[float | None], digits: Sequence[int]) -> set[int]:
    """Places of numbers that differ from another, or from zero, and read the same at these decimals."""
    found = [(i, x) for i, x in enumerate(numbers) if x is not None and np.isfinite(x)]
    places = {i for i, x in found if x != 0 and float(f"{x:.{digits[i]}f}") == 0}
    texts: dict[str, list[tuple[int, float]]] = {}
    for i, x in found:
        texts.setdefault(f"{x:.{digits[i]}f}", []).append((i, x))
    for same in texts.values():
        values = [x for _, x in same]
        if max(values) - min(values) > ALIKE * max(map(abs, values)):
            places |= {i for i, _ in same}
    return places


def _row(cells: Sequence[str]) -> str:
    first, *rest = cells
    return f'<tr><th scope="row">{first}</th>' + "".join(f"<td>{cell}</td>" for cell in rest) + "</tr>"


def _text(cell: Cell, digits: int) -> str:
    if cell is None:
        return ""
    return escape(cell) if isinstance(cell, str) else f"{cell:.{digits}f}"


def skin_rows(distances: Mapping[str, Mapping[str, Array]], roles: Mapping[str, str]) -> list[Row]:
    """Rows of a table of skin errors, as in Zheng 2022.

    After the poses come totals over each role's poses, named by the role, and over all: the mean of the
    means, the median of the medians, the largest maximum, as in the paper.

    Parameters
    ----------
    distances : mapping of str to mapping of str to array (n,)
        Distances in mm by pose and model of `SKIN_MODELS`.
    roles : mapping of str to str
        Role of each pose.

    Returns
    -------
    list of Row
        Rows with `pose`, `role` and `{model}_{statistic}` in mm.

    References
    ----------
    Zheng 2022, Table 4.
    """
    rows: list[Row] = [
        {"pose": pose, "role": roles[pose], **_statistics(by_model)} for pose, by_model in distances.items()
    ]
    found = list(dict.fromkeys(str(row["role"]) for row in rows))
    totals = [_total(role, [row for row in rows if row["role"] == role]) for role in found if len(found) > 1]
    return rows + totals + ([_total(ALL, rows)] if rows else [])


def _statistics(by_model: Mapping[str, Array]) -> dict[str, float]:
    return {
        f"{model}_{name}": statistic(np.asarray(d, float))
        for model, d in by_model.items()
        for name, statistic in STATISTICS.items()
    }


def _total(name: str, rows: Sequence[Row]) -> Row:
    totals: dict[str, float] = {}
    for model in SKIN_MODELS:
        for kind, statistic in STATISTICS.items():
            values = [float(row[f"{model}_{kind}"]) for row in rows if f"{model}_{kind}" in row]
            if values:
                totals[f"{model}_{kind}"] = statistic(np.array(values))
    return {"pose": name, "role": "", **totals}


def skin_metrics(rows: Sequence[Row]) -> Metrics:
    """Figures of skin errors: those of each pose and of the totals.

    Parameters
    ----------
    rows : sequence of Row
        Rows of `skin_rows`.

    Returns
    -------
    Metrics
        `skin_{pose}_{model}_{statistic}` in mm.
    """
    return {
        f"skin_{row['pose']}_{key}": (float(value), "mm")
        for row in rows
        for key, value in row.items()
        if key not in ("pose", "role")
    }


def skin_table(rows: Sequence[Row]) -> Table | None:
    """`skin_rows` as a table; None without rows."""
    columns = [c for c in SKIN_MODELS if any(f"{c}_mean" in row for row in rows)]
    if not columns:
        return None
    keys = [(kind, column) for kind in STATISTICS for column in columns]
    heads = [f"{kind} {column} [mm]" for kind, column in keys]
    cells: list[list[Cell]] = [
        [_pose(row), *(row.get(f"{column}_{kind}") for kind, column in keys)] for row in rows
    ]
    models = "; ".join(SKIN_MODELS[column] for column in columns)
    note = f"Distance of each vertex of the scanned skin to the simulated skin. {models}."
    return Table("Simulated against scanned skin (Zheng 2022, Table 4).", ["pose", *heads], cells, note)


def _pose(row: Row) -> str:
    return f"{row['pose']} ({row['role']})" if row["role"] else str(row["pose"])


def muscle_table(rows: Sequence[Row]) -> Table | None:
    """`muscles.error_rows` as a table, a row a muscle and a column a pose; None without rows."""
    if not rows:
        return None
    poses = list(dict.fromkeys(_pose(row) for row in rows))
    means: dict[str, dict[str, float]] = {}
    for row in rows:
        means.setdefault(str(row["muscle"]), {})[_pose(row)] = float(row["mean"])
    cells: list[list[Cell]] = [[muscle, *map(by_pose.get, poses)] for muscle, by_pose in means.items()]
    cells.append(["average", *(float(np.mean([m[p] for m in means.values() if p in m])) for p in poses)])
    note = "Mean distance between simulated and true surfaces, both ways; in neutral, of the fitted shapes."
    return Table("Muscles against truth [mm].", ["muscle", *poses], cells, note)


def rig_table(rows: Sequence[Row]) -> Table | None:
    """Rig errors by joint as a table, its last row the average over joints; None without rows.

    Parameters
    ----------
    rows : sequence of Row
        Rows with `joint`, maybe its `type` and number of `poses`, and mean errors: …_R in degrees, …_x and
        …_p in mm; `undetermined` names what the poses do not determine of the joint.

    Returns
    -------
    Table or None
        A row a joint.

    References
    ----------
    Wang 2019, Table 1.
    """
    columns = list(dict.fromkeys(key for row in rows for key in row if key.endswith(("_R", "_x", "_p"))))
    if not columns:
        return None
    cells: list[list[Cell]] = [[_joint(row), *(row.get(c) for c in columns)] for row in rows]
    present = {c: [float(row[c]) for row in rows if c in row] for c in columns}
    cells.append(["average", *(float(np.mean(present[c])) for c in columns)])
    heads = [
        f"{c.replace('loo_', 'left out ').replace('heldout_', 'held out ')} [{_unit(c)}]" for c in columns
    ]
    note = (
        "Rig against registered bones; R rotation, x translation. FM: full model; PM: without residual"
        " rotations and translations; p: corners of the bone's box. Left out: each fitted pose from the"
        " others; held out: poses that no fit"
        " saw."
    )
    guessed = [f"{row['joint']}: {row['undetermined']}" for row in rows if row.get("undetermined")]
    note += f" Not determined by the poses: {'; '.join(guessed)}." if guessed else ""
    return Table("Bone rig errors (Wang 2019, Table 1).", ["joint", *heads], cells, note)


def _joint(row: Row) -> str:
    """The joint's name, with its type and the number of fitted poses where these are stated."""
    if "type" not in row:
        return str(row["joint"])
    return f"{row['joint']} ({row['type']}, {row['poses']:.0f} poses)"


def _unit(column: str) -> str:
    return "deg" if column.endswith("_R") else "mm"


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
    plain = "_" + name.replace(".", "_").replace("/", "_") + "_"
    pose = max((p for p in poses if f"_{p}_" in plain), key=len, default="")
    rest = plain.replace(f"_{pose}_", "_", 1) if pose else plain
    return " ".join(rest.strip("_").split("_")), pose


def _short(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
