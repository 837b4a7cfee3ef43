"""Poses of the embedded hand in the benchmark of frames: within the scans, outside of them, and a path."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import islice

import numpy as np

from benchmarks.frames.mixtures import mixtures
from handpipe.skeleton.joints.angles import Angles, Limits

COUNT = {"inside": 30, "outside": 30, "path": 21}  # poses of a kind
CHUNK = 5  # poses that one job solves, at most
STEP = np.radians(1.0)  # of each flexion, from frame to frame of the path
CURL = (0.5, 1.0)  # shares of a flexion's limit in a pose outside the scans
SIDEWAYS = 0.3  # share of the limits of other angles, at most

CHUNKS = tuple(f"{kind}{i}" for kind, count in COUNT.items() for i in range(-(-count // CHUNK)))


def poses_of(
    chunk: str, scanned: Mapping[str, Angles], limits: Limits, collide: Callable[[Angles], bool]
) -> dict[str, Angles]:
    """Poses in rad of a chunk, for instance `outside2`, by the names of their frames.

    scanned: the poses of the scans. collide: whether the bones of a pose intersect.
    """
    kind = chunk.rstrip("0123456789")
    first = CHUNK * int(chunk.removeprefix(kind))
    last = min(first + CHUNK, COUNT[kind])
    found: list[Angles] = []
    if kind == "inside":
        found = list(mixtures(scanned, COUNT[kind]))
    elif kind == "outside":
        found = list(islice((p for p in curled(limits) if not collide(p)), last))
    else:
        found = list(path(mixtures(scanned, 1, seed=1)[0], limits, COUNT[kind] - 1))
    return {f"{kind} {i}": found[i] for i in range(first, last)}


def passed_over(poses: Iterable[Angles], count: int, collide: Callable[[Angles], bool]) -> int:
    """How many poses have intersecting bones before `count` poses without are found.

    Fingers that bend independently of one another run through one another: no flesh fits between them.
    """
    free = (i for i, pose in enumerate(poses) if not collide(pose))
    return next(islice(free, count - 1, None)) + 1 - count


def curled(limits: Limits, seed: int = 0) -> Iterator[dict[str, float]]:
    """Random poses in rad towards a fist: each flexion at half to all of its limit, other angles small."""
    rng = np.random.default_rng(seed)
    while True:
        share = rng.uniform(*CURL, len(limits))
        other = rng.uniform(0.0, SIDEWAYS, len(limits))
        side = rng.integers(2, size=len(limits))
        yield {
            name: float(share[i] * bounds[1] if name.endswith("flexion") else other[i] * bounds[side[i]])
            for i, (name, bounds) in enumerate(limits.items())
        }


def path(start: Angles, limits: Limits, steps: int) -> list[dict[str, float]]:
    """Poses in rad, from a start on: each flexion grows by one degree a step, up to its limit."""

    def angle(name: str, value: float, step: int) -> float:
        return min(value + step * STEP, limits[name][1]) if name.endswith("flexion") else value

    return [{n: float(angle(n, v, step)) for n, v in start.items()} for step in range(steps + 1)]
