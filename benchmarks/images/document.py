"""Tables of docs/hard-cases-images.md."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.images.rows import Row
from handpipe.core import write_text
from handpipe.synthetic.acquisition.physics.effects import AMOUNTS

COMMAND = "python -m benchmarks.images"
COLUMNS = (
    "image", "strength", "Dice mean / min", "surface, worst bone [mm]", "wrong", "of these silent",
    "false alarms", "seconds",
)  # fmt: skip


@dataclass(frozen=True)
class Table:
    """Rows of one study and the commit at which they were measured."""

    commit: str
    rows: list[Row]


def write(parts: dict[str, str], path: Path) -> None:
    """Renew what has been measured, between its markers; the rest of the document stays."""
    text = path.read_text(encoding="utf-8")
    for part, content in parts.items():
        begin, end = f"<!-- {part}: {COMMAND} -->", f"<!-- end of {part} -->"
        before, found, rest = text.partition(begin)
        _, closed, after = rest.partition(end)
        if not found or not closed:
            raise ValueError(f"{path}: lacks the markers {begin} and {end}")
        text = f"{before}{begin}\n\n{content}\n\n{end}{after}"
    write_text(path, text)


def commit() -> str:
    """Short name of the checkout's commit."""
    command = ["git", "rev-parse", "--short", "HEAD"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def rows_table(table: Table) -> str:
    """Rows as a Markdown table."""
    silent = sum(bool(row.silent) for row in table.rows)
    lines = [f"{len(table.rows)} rows at commit {table.commit}; in {silent} a wrong bone is silent.", ""]
    lines += ["| " + " | ".join(COLUMNS) + " |", "|" + " --- |" * len(COLUMNS)]
    for row in table.rows:
        cells = (
            named(row.effect),
            row.strength,
            "" if row.dice is None else f"{row.dice[0]:.3f} / {row.dice[1]:.3f}",
            "" if row.surface is None else f"{row.surface:.2f}",
            "; ".join(row.wrong) or "none",
            "; ".join(row.silent) or ("none" if row.wrong else ""),
            str(row.alarms),
            f"{row.seconds:.1f}",
        )
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def words(rows: Sequence[Row]) -> str:
    """What the library said, as a list."""
    found = [f"- {named(row.effect)}, {row.strength}: *{_short(row.said)}*" for row in rows if row.said]
    return "\n".join(["What the library said:", "", *found])


def _short(said: Sequence[str]) -> str:
    return "; ".join(said[:2]) + ("; …" if len(said) > 2 else "")


def named(effect: str) -> str:
    return f"`{effect}`" if effect in AMOUNTS else effect


def effects_table() -> str:
    """Every effect with its amounts."""
    lines = ["| effect | usual | severe | unit | what it is |", "| --- | --- | --- | --- | --- |"]
    lines += [f"| `{n}` | {a.usual:g} | {a.severe:g} | {a.unit} | {a.what} |" for n, a in AMOUNTS.items()]
    return "\n".join(lines)
