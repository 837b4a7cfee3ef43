"""The toy finger's passive tissue, solved here and by CalculiX: how far the two differ, and the two laws."""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.truth import toy
from benchmarks.truth.calculix import PROGRAM, Deck
from benchmarks.truth.isochoric import IsochoricSolid
from handpipe.core import Array, Metrics
from handpipe.fem.elements import Material
from handpipe.fem.potentials import Potential
from handpipe.fem.solver import Options, continuation
from handpipe.synthetic.coupled.coupled_body import CoupledAnatomy, CoupledBody

log = logging.getLogger(__name__)

OPTIONS = Options(displacement_tolerance=1e-9, force_tolerance=1e-10, name="engines")


def engine_differences(edge_length: float, degrees: Sequence[float]) -> Metrics:
    """Differences between engines, and between laws, in mm over the free nodes; none without CalculiX.

    The distal bone is flexed by one angle after the other. Bodies have no strands, no active stress and no
    resistance to crushing, which the other engine lacks. Figures of the last angle have no suffix.
    """
    if PROGRAM is None:
        log.warning("CalculiX (ccx) is not installed; the figures engine_* are left out")
        return {}
    anatomy = replace(toy.finger(edge_length), fibres={}, strands={})
    body, angles = CoupledBody(anatomy, toy.MATERIALS), np.radians(degrees)
    law = IsochoricSolid(body.elements, _material(anatomy))
    theirs = _calculix(body, law, angles)
    ours, stable = _followed(body, law, angles), _followed(body, body.solid, angles)
    free = ~body.fixed[::3]
    found: Metrics = {"engine_tets": (len(anatomy.mesh.tets), "1"), "engine_nodes": (len(body.rest), "1")}
    for number, degree in enumerate(degrees):
        suffix = "" if number == len(degrees) - 1 else f"_{degree:g}_degrees"
        for name, x in (("engine", ours[number]), ("engine_law", stable[number])):
            apart = np.linalg.norm(x - theirs[number], axis=1)[free]
            found[f"{name}_difference_mean{suffix}"] = (float(apart.mean()), "mm")
            found[f"{name}_difference_max{suffix}"] = (float(apart.max()), "mm")
        moved = np.linalg.norm(theirs[number] - body.rest, axis=1)[free]
        found[f"engine_displacement_max{suffix}"] = (float(moved.max()), "mm")
        volume = float(body.solid.volume_ratios(ours[number]).min())
        found[f"engine_volume_ratio_min{suffix}"] = (volume, "1")
    return found


def _material(anatomy: CoupledAnatomy) -> Material:
    """The toy's materials, one a tet."""
    constants = [(toy.MATERIALS[r].young, toy.MATERIALS[r].poisson) for r in anatomy.regions]
    young, poisson = np.array(constants, dtype=float).T[:, anatomy.labels]
    return Material(young, poisson)


def _followed(body: CoupledBody, law: Potential, angles: Array) -> list[Array]:
    """Our equilibria (n, 3) under one law at each angle in rad."""
    x, last, found = body.rest, 0.0, []
    for angle in angles.tolist():

        def prescribed(t: float, x: Array = x, last: float = last, angle: float = angle) -> Array:
            return body.prescribed(toy.hinge(last + (angle - last) * t), x)

        x = continuation(lambda _: [law], x, fixed=body.fixed, prescribed=prescribed, options=OPTIONS).x
        last = angle
        found.append(x)
    return found


def _calculix(body: CoupledBody, law: IsochoricSolid, angles: Array) -> list[Array]:
    """Its equilibria (n, 3) at each angle in rad."""
    targets = [body.prescribed(toy.hinge(angle), body.rest) for angle in angles.tolist()]
    deck = Deck(body.rest, body.elements.cells, law.moduli, body.fixed[::3], targets)
    with tempfile.TemporaryDirectory() as folder:
        return deck.run(Path(folder))
