"""Compare two results folders array by array.

Usage: python -m handpipe.develop.compare A B [--tolerance T]

HDF5 artifacts are compared by their datasets, JSON files by their values, volumes by voxels and affine,
meshes by points, cells and fields, other files by their bytes. Logs, benchmark files, the HTML report,
attributes of artifacts (commit, hashes of inputs), seconds and memory are not compared. Exit code 1 if
anything differs.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handpipe.core import Parser, number, reported
from handpipe.develop.contents import Contents, contents, is_compared

LARGEST = 1e6  # of a tolerance


@dataclass(frozen=True)
class Difference:
    """One array, or one file where `array` is empty, that is not the same in both folders."""

    path: str
    array: str
    what: str

    def __str__(self) -> str:
        """One line: the file, the array if there is one, and how they differ."""
        return f"{self.path}{f': {self.array}' if self.array else ''}: {self.what}"


def compare_folders(first: Path, second: Path, tolerance: float = 0.0) -> Iterator[Difference]:
    """Differences between two results folders.

    Parameters
    ----------
    first, second : Path
        Folders that hold the same subjects.
    tolerance : float
        Largest difference of two numbers that counts as equal, in the unit of the array.

    Yields
    ------
    Difference
        In the order of the paths.
    """
    names = [_names(first), _names(second)]
    for name in sorted(names[0] | names[1]):
        missing = [
            str(folder) for folder, known in zip((first, second), names, strict=True) if name not in known
        ]
        if missing:
            yield Difference(name, "", f"missing in {missing[0]}")
        else:
            yield from _compare_files(name, first / name, second / name, tolerance)


def _names(folder: Path) -> set[str]:
    files = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return {path.as_posix() for path in files if is_compared(path)}


def _compare_files(name: str, first: Path, second: Path, tolerance: float) -> Iterator[Difference]:
    if first.read_bytes() == second.read_bytes():
        return
    one, other = contents(first), contents(second)
    for key in sorted(one.keys() | other.keys()):
        what = _compare_arrays(one, other, key, tolerance)
        if what:
            yield Difference(name, key, what)


def _compare_arrays(one: Contents, other: Contents, key: str, tolerance: float) -> str:
    """How the arrays of one name differ; empty if they are equal within the tolerance."""
    if key not in one or key not in other:
        return f"only in the {'second' if key not in one else 'first'}"
    a, b = one[key], other[key]
    if a.shape != b.shape or a.dtype.kind != b.dtype.kind or (a.dtype != b.dtype and a.dtype.kind != "U"):
        return f"{a.dtype} {a.shape} against {b.dtype} {b.shape}"
    if a.dtype.kind not in "biufc":
        count = int(np.sum(a != b))
        return f"{count} of {a.size} texts differ" if count else ""
    return _compare_numbers(a, b, tolerance)


def _compare_numbers(a: NDArray[Any], b: NDArray[Any], tolerance: float) -> str:
    wide = complex if a.dtype.kind == "c" else np.longdouble
    with np.errstate(invalid="ignore"):
        distance = np.abs(a.astype(wide) - b.astype(wide))
    equal = (a == b) | ((a != a) & (b != b))
    distance = np.where(equal, 0, np.where(np.isnan(distance), np.inf, distance))
    count = int(np.sum(distance > tolerance))
    return f"{count} of {a.size} numbers differ, by up to {float(distance.max()):.3g}" if count else ""


def main(arguments: list[str] | None = None) -> int:
    """Print every difference and return the exit code."""
    parser = Parser(prog="python -m handpipe.develop.compare", description=__doc__)
    parser.add_argument("folders", metavar="RESULTS", nargs=2, type=Path)
    parser.add_argument(
        "--tolerance", type=number(0.0, LARGEST), default=0.0, help="largest difference that is ignored"
    )
    options = parser.parse_args(arguments)
    first, second = options.folders
    names = {folder: _names(folder) for folder in (first, second)}
    for folder, found in names.items():
        if not found:
            parser.error(f"{folder} holds no results")
    differences: list[Difference] = []
    with reported() as failure:
        differences += compare_folders(first, second, options.tolerance)
        for difference in differences:
            print(difference)
        files = len(names[first] | names[second])
        print(f"{files} files compared, {len(differences)} differences, tolerance {options.tolerance:g}")
    return failure.code or int(bool(differences))


if __name__ == "__main__":
    sys.exit(main())
