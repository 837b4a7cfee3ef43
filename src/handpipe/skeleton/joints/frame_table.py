"""A person's table of frames as text: comma, semicolon or tab between cells, decimal point or comma."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path

from handpipe.core import InputError, read_text

DELIMITERS = ",;\t"
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
NOT_FINITE = re.compile(r"[+-]?(nan|inf(inity)?)", re.IGNORECASE)
Line = tuple[int, list[str]]  # its number in the file, and its cells


def read_table(path: str | Path) -> tuple[list[str], list[Line], bool]:
    """Header and lines of a table of frames.

    The header tells what separates cells: its first cell is `frame`.

    Parameters
    ----------
    path : str or Path
        CSV file.

    Returns
    -------
    header : list of str
        Names of the columns.
    lines : list of Line
        Lines that are not empty.
    decimal_comma : bool
        Whether numbers may have a decimal comma.

    Raises
    ------
    InputError
        If the file is no text or no CSV.
    """
    text = read_text(path)
    delimiter = delimiter_of(text.partition("\n")[0])
    try:
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
        lines = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise InputError(path, "file", f"is not CSV text ({error})", "Save it as CSV in UTF-8") from error
    header = [cell.strip() for cell in lines[0][1]] if lines else []
    return header, lines[1:], delimiter != ","


def delimiter_of(header: str) -> str:
    """What stands between the cells of a header: what follows its first word, else a comma."""
    first = re.match(r'\s*"?\w+"?\s*?([,;\t])', header)
    return first.group(1) if first else ","


def frame_name(path: str | Path, line: Line, names: Sequence[str]) -> str:
    """The name in a line's first cell; raises `InputError` where it is empty, repeated or unprintable."""
    number, row = line
    name, remedy = row[0].strip(), "Give every frame a name of its own"
    where = f"row {number}, frame"
    if not name or name in names:
        problem = f"{name!r} names another frame already" if name else "is empty"
        raise InputError(path, where, problem, remedy)
    if not name.isprintable():
        raise InputError(path, where, f"{name!r} has characters that cannot be printed", remedy)
    return name


def number_in(cell: str, decimal_comma: bool = False) -> float:
    """The number that a cell holds; raises `ValueError` for anything else, "1_000" or "1.234,5" too."""
    text = cell.strip()
    if decimal_comma and "." not in text:
        text = text.replace(",", ".", 1)
    if not (NUMBER.fullmatch(text) or NOT_FINITE.fullmatch(text)):
        raise ValueError(f"{cell!r} is not a number")
    return float(text)
