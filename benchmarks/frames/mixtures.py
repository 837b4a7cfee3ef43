"""Random poses between known ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

EVEN = 0.5  # Dirichlet's parameter: most mixtures are of a few poses, some of one nearly alone


def mixtures(
    scanned: Mapping[str, Mapping[str, float]], count: int, seed: int = 0, reach: float = 1.0
) -> list[dict[str, float]]:
    """Angles in rad of poses that mix the scanned ones' angles, neutral's, which are zero, among them.

    The shares of a mixture are at least zero and sum to `reach`, with neutral's to one.
    """
    names = sorted({angle for angles in scanned.values() for angle in angles})
    known = np.array([[angles[n] for n in names] for angles in scanned.values()])
    shares = np.random.default_rng(seed).dirichlet(np.full(len(known) + 1, EVEN), count)[:, 1:]
    return [dict(zip(names, map(float, row), strict=True)) for row in reach * shares @ known]
