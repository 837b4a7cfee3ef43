"""The readers' table: files of the ordinary world, each read right or refused with the reason.

A row is a format, a dialect of it and a defect. A case either has to be read, and an independent reader
checks the result, or has to be refused by an `InputError` that names what is wrong.
"""

from __future__ import annotations

import importlib
import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from handpipe.core import InputError, Metrics

log = logging.getLogger(__name__)
T = TypeVar("T")

RIGHT, REFUSED = "right", "refused"
TABLES = ("volume_rows", "surface_rows")  # modules with rows() -> list[Row]


@dataclass(frozen=True)
class Row:
    """One file and what came of it: `verdict` is "right", "refused", or what went wrong."""

    format: str
    dialect: str
    defect: str
    verdict: str

    @property
    def wrong(self) -> bool:
        return self.verdict not in (RIGHT, REFUSED)


def read_right(format: str, dialect: str, read: Callable[[], T], mistake: Callable[[T], str]) -> Row:
    """A file that has to be read; `mistake` says what is wrong with the result, "" where nothing is."""
    try:
        verdict = mistake(read()) or RIGHT
    except Exception as error:  # any exception is a wrong verdict here
        verdict = f"{type(error).__name__}: {error}"
    return Row(format, dialect, "", verdict)


def refused(format: str, dialect: str, defect: str, read: Callable[[], object], reason: str) -> Row:
    """A file that has to be refused: the error names `reason` and says what to do."""
    try:
        read()
        verdict = "accepted without a word"
    except InputError as error:
        named = reason.lower() in str(error).lower() and bool(error.remedy)
        verdict = REFUSED if named else f"refused without the reason {reason!r}: {error}"
    except Exception as error:  # a foreign exception
        verdict = f"{type(error).__name__}: {error}"
    return Row(format, dialect, defect, verdict)


def rows() -> list[Row]:
    """The rows of all tables that are here."""
    found: list[Row] = []
    for name in TABLES:
        if Path(__file__).with_name(f"{name}.py").exists():
            found += importlib.import_module(f"benchmarks.trust.{name}").rows()
    return found


def measure(results: Path) -> Metrics:
    """`reader_rows`, how many files were tried; `reader_wrong`, how many were neither right nor refused."""
    table = rows()
    for row in table:
        log.info("%s | %s | %s | %s", row.format, row.dialect, row.defect or "-", row.verdict)
    return {
        "reader_rows": (float(len(table)), "1"),
        "reader_wrong": (float(sum(row.wrong for row in table)), "1"),
    }
