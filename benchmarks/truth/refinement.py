"""The toy finger on meshes that are refined within one shape, with linear and with quadratic elements."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, replace
from typing import Literal

from benchmarks.truth import toy
from handpipe.core import Array
from handpipe.fem.solver import Options
from handpipe.synthetic.coupled import volume_changes
from handpipe.synthetic.coupled.coupled_body import CoupledAnatomy, CoupledBody
from handpipe.synthetic.coupled.follow import follow
from handpipe.synthetic.coupled.validation import difference, solved_from

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Solved:
    """One body, its equilibrium x (n, 3), and processor seconds to it from the coarser one's."""

    order: Literal[1, 2]
    level: int
    body: CoupledBody
    x: Array
    seconds: float


def solved(edge: float, angle: float, refinements: int, *, strands: bool = True) -> list[Solved]:
    """The toy flexed by `angle` rad: quadratic elements at every level, then linear ones; finest first."""
    anatomies: list[CoupledAnatomy] = [toy.finger(edge)]
    if not strands:
        anatomies[0] = replace(anatomies[0], strands={})
    for _ in range(refinements):
        anatomies.append(anatomies[-1].refined())
    pose = toy.hinge(angle)
    quadratic: list[Solved] = []
    for level, anatomy in enumerate(anatomies):
        begun = time.process_time()
        body = CoupledBody(anatomy, toy.MATERIALS)
        if level == 0:
            x = follow(body, lambda t: toy.hinge(angle * t)).x
        else:
            x = solved_from(quadratic[-1].body, quadratic[-1].x, body, pose, Options(name=f"level {level}"))
        quadratic.append(Solved(2, level, body, x, time.process_time() - begun))
        log.info("level %d: %d tets, %.0f s", level, len(anatomy.mesh.tets), quadratic[-1].seconds)
    linear = []
    for level, anatomy in enumerate(anatomies):
        near = quadratic[max(level - 1, 0)]
        begun = time.process_time()
        body = CoupledBody(anatomy, toy.MATERIALS, order=1)
        x = solved_from(near.body, near.x, body, pose)
        linear.append(Solved(1, level, body, x, time.process_time() - begun))
    return [*quadratic[::-1], *linear[::-1]]


def figures(found: list[Solved]) -> dict[str, dict[str, float]]:
    """Of each body: tets, nodes, distances from the finest one, its muscle's change of volume, seconds."""
    reference, table = found[0], {}
    for s in found:
        row: dict[str, float] = {"order": s.order, "level": s.level, "nodes": len(s.x)}
        row["tets"], row["seconds"] = len(s.body.anatomy.mesh.tets), s.seconds
        row["volume_change"] = volume_changes(s.body, s.x)["flexor"]
        measured = difference(s.body, s.x, reference.body, reference.x)
        table[f"order {s.order}, level {s.level}"] = row | {name: v for name, (v, _) in measured.items()}
    return table
