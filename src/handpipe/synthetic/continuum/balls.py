"""Means of a field over small balls, by which a thick tendon is coupled to the tissue around it."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array
from handpipe.mesh.tets import Locator
from handpipe.synthetic.continuum.elements import Elements

GOLDEN = (1 + np.sqrt(5)) / 2  # the golden ratio
CORNERS = np.array([[0, i, j * GOLDEN] for i in (-1, 1) for j in (-1, 1)]) / np.hypot(1, GOLDEN)
# A centre and the corners of an icosahedron.
SAMPLES = np.concatenate([np.zeros((1, 3)), *(np.roll(CORNERS, axis, axis=1) for axis in range(3))])


def ball_means(elements: Elements, points: Array, radius: float) -> sp.csr_matrix:
    """Matrix (p, n) from nodes to the means of a field over balls of a radius in mm about points (p, 3).

    The mean of thirteen samples, of those that lie in the mesh: a force on a point must be spread, since the
    displacement under it would grow without bound as the mesh is refined.
    """
    samples = points[:, None] + radius * SAMPLES
    inside = (Locator(elements.mesh).tets(samples.reshape(-1, 3)) >= 0).reshape(samples.shape[:2])
    inside[:, 0] |= ~inside.any(axis=1)  # a point outside is carried by the nearest tet
    rows = np.nonzero(inside)[0]
    share = 1.0 / inside.sum(axis=1)[rows]
    mean = sp.csr_matrix((share, (rows, np.arange(len(rows)))), shape=(len(points), len(rows)))
    return sp.csr_matrix(mean @ elements.interpolation(samples[inside]))
