"""One body of a simulated frame as an input deck of Abaqus and CalculiX."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from handpipe.core import Array, IntArray, RigidTransform, write_text
from handpipe.fem.potentials import Elastic
from handpipe.mesh.tets import TetMesh

STEPS = 20  # shares of tissue, and moduli of more than as many values, are rounded to as many steps
A_LINE = 8  # numbers of elements on a line of a set
NUMBER = ".12e"  # at most 20 characters, the longest field that CalculiX reads


def write_deck(path: str | Path, elastic: Elastic, x: Array, title: str) -> None:
    """Write an input deck of a body whose surface takes its places in a frame.

    The deck has the tets at rest, moved rigidly to where they fit the frame best (C3D4); the displacements of
    all vertices of their boundary (*BOUNDARY); and a static step with large displacements, which finds the
    inner vertices. The material is neo-Hookean, W = C10 (I1' - 3) + (J - 1)^2 / D1, with C10 = mu / 2 and
    D1 = 2 / (lambda + 2 mu / 3): at small strains it is the material of the simulation. A share of tissue
    scales both. Moduli of more than 20 values are rounded to 20 equal ratios. Plastic strain is not in the
    deck. Units are mm, mN and kPa.

    Parameters
    ----------
    path : path
        File to be written.
    elastic : Elastic
        The body's potential: rest shape, tets, material, shares of tissue.
    x : array (n, 3)
        Vertices in the frame in mm.
    title : str
        Heading, one line.
    """
    placed = RigidTransform.fit(elastic.vertices, x)(elastic.vertices)
    boundary = TetMesh(placed, elastic.tets).boundary_vertices()
    lines = [
        "*HEADING",
        title,
        "** mm, mN, kPa. Neutral tets, rigidly moved to the frame; plastic strain is not in this deck.",
        "*NODE, NSET=ALL",
        *(f"{n}, {_numbers(place)}" for n, place in enumerate(placed.tolist(), start=1)),
        "*ELEMENT, TYPE=C3D4, ELSET=BODY",
        *(f"{n}, {a}, {b}, {c}, {d}" for n, (a, b, c, d) in enumerate((elastic.tets + 1).tolist(), start=1)),
        *_materials(elastic),
        "*STEP, NLGEOM, INC=1000",
        "*STATIC",
        "0.25, 1.",
        "*BOUNDARY",
        *_displacements(boundary, (x - placed)[boundary]),
        "*NODE PRINT, NSET=ALL",
        "U",
        "*EL PRINT, ELSET=BODY",
        "S",
        "*END STEP",
    ]
    write_text(path, "\n".join(lines) + "\n")


def _materials(elastic: Elastic) -> Iterator[str]:
    """Sets of elements by share of tissue, each with its material."""
    mu, lam = (_in_steps(moduli) for moduli in elastic.material.lame(len(elastic.tets)))
    shares = np.maximum(np.round(STEPS * elastic.weights), 1) / STEPS
    shares = elastic.weights if len(np.unique(elastic.weights)) == 1 else shares
    constants = np.column_stack([shares * mu / 2, 2 / (shares * (lam + 2 * mu / 3))])
    kinds, kind = np.unique(constants, axis=0, return_inverse=True)
    kind = np.asarray(kind).ravel()
    for number, (c10, d1) in enumerate(kinds.tolist(), start=1):
        members = np.flatnonzero(kind == number - 1) + 1
        yield f"*ELSET, ELSET=PART{number}"
        yield from (
            ", ".join(map(str, members[at : at + A_LINE].tolist())) for at in range(0, len(members), A_LINE)
        )
        yield f"*MATERIAL, NAME=TISSUE{number}"
        yield "*HYPERELASTIC, NEO HOOKE"
        yield _numbers((c10, d1))
        yield f"*SOLID SECTION, ELSET=PART{number}, MATERIAL=TISSUE{number}"


def _in_steps(values: Array) -> Array:
    """Values (m,) above 0; more than `STEPS` kinds are rounded to equal ratios: soft ones stay soft."""
    if len(np.unique(values)) <= STEPS:
        return values
    logs = np.log(values)
    low, span = logs.min(), np.ptp(logs)
    return np.exp(low + span * np.round(STEPS * (logs - low) / span) / STEPS)


def _displacements(vertices: IntArray, moves: Array) -> Iterator[str]:
    for vertex, move in zip((vertices + 1).tolist(), moves.tolist(), strict=True):
        yield from (f"{vertex}, {axis}, {axis}, {value:{NUMBER}}" for axis, value in enumerate(move, start=1))


def _numbers(values: Iterable[float]) -> str:
    return ", ".join(f"{value:{NUMBER}}" for value in values)
