"""The 26 feature points that steer a template to a person: files, missing and doubtful points.

The method is that of Albrecht 2003 §5.1. Points are named by the joint or fingertip under them, rays 1
(thumb) to 5: `tip1` ... `tip5`, `DIP2` ... `DIP5`, `IP1`, `PIP2` ... `PIP5`, `MP1` ... `MP5` on the back of
the knuckles, `web12` ... `web45` in the skin between two rays, `wrist_radial`, `wrist_ulnar` and `ulna_head`.
"""

from __future__ import annotations

import csv
import logging
from collections.abc import Collection, Mapping
from itertools import combinations
from pathlib import Path

import numpy as np

from handpipe.core import Array, InputError, read_text
from handpipe.imaging.evidence import read_landmarks, write_markers
from handpipe.mesh.surfaces import left_out
from handpipe.tissues.muscles.fitting import fit_similarity

Points = Mapping[str, Array]

log = logging.getLogger(__name__)

FINGERS = (2, 3, 4, 5)  # rays with three phalanges
NAMES = (
    *(f"tip{ray}" for ray in (1, *FINGERS)),
    *(f"DIP{ray}" for ray in FINGERS),
    "IP1",
    *(f"PIP{ray}" for ray in FINGERS),
    *(f"MP{ray}" for ray in (1, *FINGERS)),
    *(f"web{ray}{ray + 1}" for ray in (1, *FINGERS[:-1])),
    "wrist_radial",
    "wrist_ulnar",
    "ulna_head",
)
FEWEST = 8  # with which all five rays can be distinguished
REASONABLE = 16  # with which Albrecht 2003 had reasonable hands
NEAREST = 0.012  # share of the hand's extent within which two points coincide: 2 mm of an adult's
COLUMNS = ["point", "x", "y", "z"]  # of a table
# mm, for hands of one size. In two adults' hands in different poses, points are up to 14 mm from where the
# others lead to, so that a smaller error cannot be distinguished from how people differ.
DOUBT = 15.0


def read(path: str | Path) -> dict[str, Array]:
    """Read feature points of a `.mrk.json` file whose labels are among `NAMES`.

    Parameters
    ----------
    path : path
        File of 3D Slicer.

    Returns
    -------
    mapping of str to array (3,)
        Points in mm, RAS, by name.

    Raises
    ------
    InputError
        For a label that is no feature point, and for too few points (`require_enough`).
    """
    points = read_landmarks(path)
    for name in points:
        if name not in NAMES:
            raise InputError(path, "label", f"{name!r} is no feature point", f"Use {', '.join(NAMES)}")
    require_enough(points, path)
    return points


def read_table(path: str | Path) -> dict[str, Array]:
    """Read feature points of a CSV file with the header `point,x,y,z`, in mm.

    Parameters
    ----------
    path : path
        File.

    Returns
    -------
    mapping of str to array (3,)
        Points in mm by name.

    Raises
    ------
    InputError
        For another header, a row that is no feature point, and points that coincide.
    """
    header, *rows = [*csv.reader(read_text(path).splitlines())] or [[]]
    if [cell.strip() for cell in header] != COLUMNS:
        given = ",".join(header)
        raise InputError(path, "header", f"is {given!r}", f"Write {','.join(COLUMNS)}; lengths are in mm")
    points: dict[str, Array] = {}
    for number, row in enumerate((row for row in rows if row), start=1):
        name = row[0].strip()
        if name not in NAMES or name in points:
            problem = f"{name!r} stands twice" if name in points else f"{name!r} is no feature point"
            raise InputError(path, f"row {number}", problem, f"Use each of {', '.join(NAMES)} once")
        try:
            points[name] = np.array([float(cell) for cell in row[1:]])
        except ValueError:
            points[name] = np.array([np.nan])
        if points[name].shape != (3,) or not np.isfinite(points[name]).all():
            raise InputError(path, f"row {number}", f"{name} has no three numbers", "Give x, y, z in mm")
    require_apart(points, path)
    return points


def require_apart(points: Points, source: str | Path) -> None:
    """Check that no two feature points coincide.

    Parameters
    ----------
    points : mapping of str to array
        Feature points by name, in any unit.
    source : path
        The file of the points, for messages.

    Raises
    ------
    InputError
        For two points at one place; the text names both.
    """
    extent = np.ptp([*points.values()], axis=0).max(initial=0.0)
    for a, b in combinations(points, 2):
        if np.linalg.norm(points[a] - points[b]) <= NEAREST * extent:
            problem = "lie at one place"
            raise InputError(source, f"{a}, {b}", problem, "Move one of them to where it belongs")


def write(path: str | Path, points: Points) -> None:
    """Write feature points as fiducials of 3D Slicer, in the order of `NAMES`."""
    names = [name for name in NAMES if name in points]
    write_markers(path, np.array([points[name] for name in names]), names)


def missing(points: Points) -> tuple[str, ...]:
    """Names of the absent feature points."""
    return tuple(name for name in NAMES if name not in points)


def require_enough(
    points: Mapping[str, object],
    source: str | Path,
    fewest: int = FEWEST,
    among: Collection[str] = NAMES,
) -> None:
    """Check that feature points are enough for a warp.

    Parameters
    ----------
    points : mapping of str to object
        Feature points by name.
    source : path
        The file of the points, for messages.
    fewest : int
        Least number of points.
    among : collection of str
        Points that count, for messages.

    Raises
    ------
    InputError
        For fewer points, or where a ray has none of its own.
    """
    absent = ", ".join(name for name in NAMES if name in among and name not in points)
    if len(points) < fewest:
        problem = f"only {len(points)} of at least {fewest} points"
        raise InputError(source, "feature points", problem, f"Place more of {absent}")
    for ray in (1, *FINGERS):
        if not {f"{kind}{ray}" for kind in ("tip", "DIP", "IP", "PIP", "MP")} & set(points):
            problem = f"ray {ray} has no point on its tip or knuckles"
            raise InputError(source, "feature points", problem, f"Place one of {absent}")


def matched(source: Points, target: Points, origin: str | Path) -> tuple[tuple[str, ...], Array, Array]:
    """Feature points that both hands have.

    Parameters
    ----------
    source, target : mapping of str to array (3,)
        Feature points in mm by name.
    origin : path
        The file of the points, for messages.

    Returns
    -------
    names : tuple of str
        Names in the order of `NAMES`.
    source, target : array (n, 3)
        Points in mm.

    Raises
    ------
    InputError
        For too few points, see `require_enough`.
    """
    both = [name for name in NAMES if name in source and name in target]
    require_enough(dict.fromkeys(both), origin)
    return tuple(both), np.array([source[n] for n in both]), np.array([target[n] for n in both])


def doubtful(source: Points, target: Points, limit: float = DOUBT) -> dict[str, float]:
    """Targets that contradict the others.

    In each round the point without which the rest agree best is removed, as long as it is farther off than
    the limit. A point at the end of a chain and the one before it are hard to distinguish: check both.

    Parameters
    ----------
    source, target : mapping of str to array (3,)
        Feature points in mm by name.
    limit : float
        Largest distance in mm, for two hands of one size.

    Returns
    -------
    mapping of str to float
        Distance in mm of each doubtful point from where the others' warp puts it.
    """
    names, a, b = matched(source, target, "feature points")
    scale = float(np.cbrt(np.linalg.det(fit_similarity(a, b).matrix)))
    found: dict[str, float] = {}
    kept = np.arange(len(names))
    while len(kept) > FEWEST:
        away = np.linalg.norm(left_out(a[kept], b[kept]), axis=1)
        if (away < limit * scale).all():
            break
        disagreement = [
            float((left_out(a[rest], b[rest]) ** 2).sum())
            for rest in (np.delete(kept, i) for i in range(len(kept)))
        ]
        worst = int(np.argmin(disagreement))
        if away[worst] < limit * scale:
            break
        found[names[kept[worst]]] = float(away[worst])
        kept = np.delete(kept, worst)
    return found


def require_plausible(source: Points, target: Points, path: str | Path, limit: float = DOUBT) -> None:
    """Check that no feature point contradicts the others; the log names missing points.

    Parameters
    ----------
    source, target : mapping of str to array (3,)
        Feature points in mm by name.
    path : path
        The file of the target points, for messages.
    limit : float
        As in `doubtful`.

    Raises
    ------
    InputError
        For doubtful points; the text names them.
    """
    absent = [name for name in missing(target) if name in source]
    if absent:
        log.warning("%s: without the feature points %s", path, ", ".join(absent))
    doubts = doubtful(source, target, limit)
    if doubts:
        said = ", ".join(f"{name} lies {away:.0f} mm" for name, away in doubts.items())
        problem = f"{said} from where the other points' warp puts it"
        remedy = "Look whether it is misplaced or its name is another's; mend it or leave it out"
        raise InputError(path, ", ".join(doubts), problem, remedy)
