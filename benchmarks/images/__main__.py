"""`python -m benchmarks.images`: the physical image model beside real images, and bones under its effects.

Writes the figures to results/benchmarks/images.json, the rows beside it and, with --document, the tables and
the figure of docs/hard-cases-images.md.
"""

from __future__ import annotations

import argparse
import json
import logging
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.threads import take_threads

if TYPE_CHECKING:  # loading them loads numba, which reads its number of threads then
    from benchmarks.images.document import Table
    from handpipe.core import Metrics

CHECKOUT = Path(__file__).parents[2]
OUTPUT = CHECKOUT / "results" / "benchmarks" / "images.json"
DOCUMENT = CHECKOUT / "docs" / "hard-cases-images.md"
PICTURE = CHECKOUT / "docs" / "figures" / "image-model.png"
SCANS = CHECKOUT / "docs" / "scans.md"
PARTS = ("effects", "coarse", "sweep", "calibration", "chain")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the parts asked for; rows of the others are kept from the file beside the figures."""
    take_threads(1)
    options = _options(arguments)
    from benchmarks.images import calibration, document, rows
    from handpipe.core import metrics, write_text

    kept = options.output.with_name(f"{options.output.stem}-rows.json")
    stored = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    tables = {
        part: document.Table(found["commit"], [rows.Row(**row) for row in found["rows"]])
        for part, found in stored.items()
    }
    studies = {
        "effects": lambda: rows.settings(),
        "coarse": lambda: rows.settings(rows.COARSE),
        "sweep": rows.sweep,
    }
    options.output.parent.mkdir(parents=True, exist_ok=True)
    if options.what:
        rows.measure("compiles", "", rows.Setting(spacing=rows.COARSE))
    for part in [p for p in options.what if p in studies]:
        measured = [rows.measure(*setting) for setting in studies[part]()]
        tables[part] = document.Table(document.commit(), measured)
        write_text(kept, json.dumps({p: asdict(t) for p, t in tables.items()}, indent=1) + "\n")
    found = metrics.read(options.output) if options.output.exists() else {}
    nothing = document.Table("", [])
    found |= rows.figures(tables.get("effects", nothing).rows, tables.get("coarse", nothing).rows)
    if "calibration" in options.what:
        levels = [*calibration.real(), *(calibration.modelled(echo) for echo in calibration.ECHOES)]
        found |= calibration.figures(levels)
        if options.document:
            calibration.draw(levels, PICTURE)
            document.write({"calibration": calibration.table(levels)}, DOCUMENT)
    if "chain" in options.what:
        found |= _chain(options.document)
    metrics.write(options.output, found)
    if options.document:
        document.write(_texts(tables), DOCUMENT)


def _chain(documented: bool) -> Metrics:
    """Figures of the whole chain; its rows are kept, so that a run that was broken off goes on."""
    from benchmarks.images import document
    from benchmarks.images.chain import document as tables
    from benchmarks.images.chain import rows

    kept = rows.file_in(OUTPUT.parent)
    alone, swept = ([*rows.measured(cases, kept)] for cases in (rows.cases(), rows.sweep()))
    if documented:
        document.write({"chain": tables.chain_table(alone, document.commit())}, DOCUMENT)
        document.write({"chain sweep": tables.sweep_table(swept)}, SCANS)
    return rows.figures(alone) | rows.sweep_figures(swept)


def _texts(tables: dict[str, Table]) -> dict[str, str]:
    from benchmarks.images import document

    texts = {"amounts": document.effects_table()}
    for part, table in tables.items():
        texts[part] = document.rows_table(table)
    if "effects" in tables:
        texts["effects"] += "\n\n" + document.words(tables["effects"].rows)
    return texts


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.images", description=__doc__)
    parser.add_argument("what", nargs="*", help=f"parts: {', '.join(PARTS)}; by default all")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    parser.add_argument("--document", action="store_true", help=f"renew {DOCUMENT.name}")
    options = parser.parse_args(arguments)
    unknown = set(options.what) - set(PARTS)
    if unknown:
        parser.error(f"unknown: {', '.join(sorted(unknown))}; there are {', '.join(PARTS)}")
    if not options.what and not options.document:
        options.what = list(PARTS)
    return options


if __name__ == "__main__":
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(name)s: %(message)s", stream=sys.stderr)
    logging.getLogger("benchmarks").setLevel(logging.INFO)
    main()
