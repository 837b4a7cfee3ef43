"""Upper envelopes of many functions on large meshes."""

from __future__ import annotations

import time

import numpy as np

from benchmarks.fem.scenes import grid
from handpipe.anatomy.templates.envelope import upper_envelope
from handpipe.core import Metrics
from handpipe.mesh.tets import TetMesh
from handpipe.synthetic.geometry.implicit import round_cone

FUNCTIONS = 39  # as many as the largest model of Abdrashitov 2021 has
SIDES = (24, 48)  # cells of six tets along a cube's edge


def measure() -> Metrics:
    """Processor seconds for functions about lines through a cut cube, and tets in and out."""
    upper_envelope(*_field(2))  # compiled beforehand
    found: Metrics = {}
    for side in SIDES:
        mesh, values = _field(side)
        start = time.process_time()
        envelope = upper_envelope(mesh, values)
        name = f"envelope_{len(mesh.tets)}"
        found[f"{name}_seconds"] = (time.process_time() - start, "s")
        found[f"{name}_tets_out"] = (float(len(envelope.labels)), "1")
    return found


def _field(side: int) -> tuple[TetMesh, np.ndarray]:
    """A cube's tets, and functions that fall off with the distance from random segments, as muscles' do."""
    body = grid(*[np.linspace(0, 1, side + 1)] * 3)
    starts, ends = np.random.default_rng(0).random((2, FUNCTIONS, 3))
    away = [-round_cone(a, b, 0.0, 0.0)(body.vertices) for a, b in zip(starts, ends, strict=True)]
    return TetMesh(body.vertices, body.tets), np.column_stack(away)
