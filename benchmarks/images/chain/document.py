"""Tables of the chain for docs/hard-cases-images.md and docs/scans.md."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from benchmarks.images.chain.rows import Row
from benchmarks.images.chain.verdicts import Error
from benchmarks.images.document import named

COLUMNS = (
    "image", "strength", "Dice, least", "turn / shift of bones, largest", "tendons [mm]", "muscles [mm]",
    "skin [mm]", "wrong", "of these silent", "false alarms", "seconds",
)  # fmt: skip
SWEPT = (
    "voxel [mm]", "image", "Dice, least", "turn / shift of bones, largest", "tendons [mm]",
    "muscles [mm]", "skin [mm]", "seconds", "outcome",
)  # fmt: skip


def chain_table(rows: Sequence[Row], commit: str) -> str:
    """Every row as a Markdown table."""
    silent, refused = (
        sum(bool(found) for found in (getattr(r, n) for r in rows)) for n in ("silent", "refused")
    )
    lines = [
        f"{len(rows)} rows at commit {commit}; in {refused} the neutral pose is refused by name, "
        f"in {silent} a wrong organ is silent.",
        "",
        *_head(COLUMNS),
    ]
    for row in rows:
        cells = (named(row.effect), row.strength, *_errors(row), _wrong(row), _words(row.silent), *_rest(row))
        lines.append(_line(cells))
    return "\n".join(lines)


def sweep_table(rows: Sequence[Row]) -> str:
    """Speed against error: voxel sizes and noise."""
    lines = _head(SWEPT)
    for row in rows:
        outcome = _wrong(row) if row.wrong else "right"
        if row.silent:
            outcome += f"; **silent**: {_words(row.silent)}"
        strength = f"{named(row.effect)}, {row.strength}"
        lines.append(_line((f"{row.voxel:g}", strength, *_errors(row), _rest(row)[1], outcome)))
    return "\n".join(lines)


def _errors(row: Row) -> tuple[str, ...]:
    turn, shift = row.worst("turn"), row.worst("shift")
    moved = "" if turn is None or shift is None else f"{turn:.1f} deg / {shift:.2f} mm"
    lines, muscles, skin = (row.worst(kind) for kind in ("centreline", "muscle", "skin"))
    numbers = [None if v is None else f"{v:.2f}" for v in (lines, muscles, skin)]
    dice = row.worst("Dice")
    return ("" if dice is None else f"{dice:.3f}", moved, *(n or "" for n in numbers))


def _wrong(row: Row) -> str:
    """Wrong figures, those that the registration itself states apart."""
    if row.refused:
        return f"refused for {', '.join(sorted(row.refused))}"
    stated = row.stated
    noticed = [e for e in row.wrong if e not in stated and e not in row.silent]
    parts = [_words(noticed)] if noticed else []
    if stated:
        parts.append(f"within the stated deviation: {_words(stated)}")
    return "; ".join(parts) or ("" if row.silent else "none")


def _words(errors: Iterable[Error]) -> str:
    return "; ".join(map(str, errors))


def _rest(row: Row) -> tuple[str, str]:
    return str(len(row.alarms)), f"{sum(row.seconds.values()):.0f}"


def _head(columns: Sequence[str]) -> list[str]:
    return ["| " + " | ".join(columns) + " |", "|" + " --- |" * len(columns)]


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"
