"""Against other methods: the bent, growing beam and the stretched muscle (Wang 2021 Fig. 5.3, 5.13, 5.21 to
5.25).

All methods get the same marks and attachments on the same meshes, whose cells are those of the coarsest, a
half and a third as wide. Errors of the whole surface and of the volume are against the true map of the same
mesh, so that what the mesh cannot show is no method's error.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.fem.machine import Figures, figure
from benchmarks.shapes.bodies import surface_errors
from benchmarks.shapes.comparison_bodies import BODIES, Body
from benchmarks.shapes.comparison_picture import draw
from benchmarks.shapes.other_methods import METHODS
from benchmarks.shapes.spikiness import Neighbourhood
from handpipe.core import Array, ConvergenceError

log = logging.getLogger("benchmarks.shapes")

PICTURE = Path(__file__).parents[2] / "docs" / "figures" / "shapes-comparisons.png"
REACH = 6.0  # mm about a mark
UNITS = {
    "marks_mean": "mm",
    "marks_max": "mm",
    "attached_max": "mm",
    "surface_mean": "mm",
    "surface_max": "mm",
    "volume": "%",
    "spikiness": "1",
    "normals_mean": "deg",
    "normals_max": "deg",
    "seconds": "s",
}


@dataclass(frozen=True)
class Case:
    """A body, and the region near its marks that spikes are looked for in."""

    body: Body
    near: Neighbourhood

    @staticmethod
    def build(name: str, refinements: int) -> Case:
        body = BODIES[name](refinements)
        return Case(body, Neighbourhood.around(body.mesh.boundary(), body.marked, body.side, REACH))

    def measures(self, x: Array) -> dict[str, float]:
        """By the names in `UNITS`, without the seconds, of the shape x (n, 3)."""
        body, found = self.body, self.body.mesh.moved(x)
        apart = np.linalg.norm(x - body.truth, axis=1)
        surface = surface_errors(found, body.wanted)
        normals = self.near.normal_errors(x, body.truth)
        volume = found.boundary().volume() / body.wanted.boundary().volume()
        return {
            "marks_mean": float(apart[body.marked].mean()),
            "marks_max": float(apart[body.marked].max()),
            "attached_max": float(apart[body.attached].max()),
            "surface_mean": float(surface.mean()),
            "surface_max": float(surface.max()),
            "volume": 100 * (volume - 1),
            "spikiness": self.near.spikiness(x),
            "normals_mean": float(normals.mean()),
            "normals_max": float(normals.max()),
        }


def measure(refinements: int = 2, picture: Path | None = PICTURE) -> Figures:
    """`comparison_{body}_{method}_{measure}_{refinement}`; method `truth`: what a smooth body measures."""
    out: Figures = {}
    shapes: dict[str, dict[str, Array]] = {}
    for name in BODIES:
        for refinement in range(refinements + 1):
            case = Case.build(name, refinement)
            key = f"comparison_{name}_{{}}_{refinement}"
            out[key.format("tets")] = figure(float(len(case.body.mesh.tets)), "1")
            out[key.format("truth_spikiness")] = figure(case.near.spikiness(case.body.truth), "1")
            shapes[name] = {"truth": case.body.truth}
            for method in METHODS:
                found = shape_by(METHODS[method], case.body, method)
                if isinstance(found, str):
                    out |= {key.format(f"{method}_{m}"): figure(None, u, found) for m, u in UNITS.items()}
                    continue
                x, seconds = found
                shapes[name][method] = x
                values = case.measures(x) | {"seconds": seconds}
                out |= {key.format(f"{method}_{m}"): figure(values[m], u) for m, u in UNITS.items()}
    if picture is not None:
        draw(picture, shapes, {name: BODIES[name](refinements) for name in BODIES}, out, refinements)
    return out


def shape_by(method: Callable[[Body], Array], body: Body, name: str) -> tuple[Array, float] | str:
    """Vertices (n, 3) that a method finds and its processor seconds, or why there are none."""
    begun = time.process_time()
    try:
        x = method(body)
    except ConvergenceError as error:
        return str(error)
    seconds = time.process_time() - begun
    log.info("%s on %d tets: %.1f s", name, len(body.mesh.tets), seconds)
    return x, seconds
