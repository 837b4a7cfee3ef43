"""CalculiX, a finite-element program that is no part of this project, run on a body of quadratic tets."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, BoolArray, ConvergenceError, InputError, IntArray, write_text

PROGRAM = shutil.which("ccx")
IN_ITS_ORDER = [0, 1, 2, 3, 4, 7, 5, 6, 8, 9]  # our ten nodes of a tet in the order of C3D10
ITS_SIDES = {3: 1, 2: 2, 0: 3, 1: 4}  # its number of a tet's face, by our corner opposite to it
A_LINE = 8  # numbers on a line of a set
NUMBER = ".12e"  # at most 20 characters, the longest field that CalculiX reads
SECONDS = 900.0  # that a run may take
INCREMENT = 0.25  # first one of a step
CONTACT_STIFFNESS = 1000.0  # kPa of pressure a mm of overlap
# Iterations before an increment is cut; largest force and correction relative to their means. By default
# CalculiX accepts 0.5 % and 1 %.
CONTROLS = (
    "*CONTROLS, PARAMETERS=TIME INCREMENTATION",
    "12, 16, 40, 60, 20, 4, , 10",
    "",
    "*CONTROLS, PARAMETERS=FIELD",
    "1.e-9, 1.e-7, , , 1.e-9, 1.e-12, 1.e-7, 1.e-12",
)


@dataclass(frozen=True, eq=False)
class Deck:
    """A body for CalculiX, in mm, mN and kPa.

    nodes (n, 3), cells (m, 10) in our order, shear and bulk moduli (m,) of the neo-Hookean law of
    `IsochoricSolid`. The nodes of `prescribed` (n,) are moved to their places in each of `targets`, one step
    each; `contact` has the lines of a model with surfaces that touch.
    """

    nodes: Array
    cells: IntArray
    moduli: tuple[Array, Array]
    prescribed: BoolArray
    targets: Sequence[Array]
    touching: tuple[IntArray, IntArray] | None = None

    def write(self, path: Path) -> None:
        """Write the input deck."""
        cells = (self.cells[:, IN_ITS_ORDER] + 1).tolist()
        lines = [
            "*NODE, NSET=ALL",
            *(f"{n}, {_numbers(place)}" for n, place in enumerate(self.nodes.tolist(), start=1)),
            "*ELEMENT, TYPE=C3D10, ELSET=BODY",
            *(f"{n}, {', '.join(map(str, nodes))}" for n, nodes in enumerate(cells, start=1)),
            *self._materials(),
            *self._contact(),
            *(line for target in self.targets for line in self._step(target)),
        ]
        write_text(path, "\n".join(lines) + "\n")

    def run(self, folder: Path) -> list[Array]:
        """Positions (n, 3) at the end of each step; a folder for the program's files, which is made.

        Raises
        ------
        InputError
            If CalculiX is not installed.
        ConvergenceError
            If CalculiX ends before the last step.
        """
        if PROGRAM is None:
            raise InputError("CalculiX", "ccx", "is not installed", "Install calculix-ccx of Debian")
        folder.mkdir(parents=True, exist_ok=True)
        self.write(folder / "deck.inp")
        done = subprocess.run(
            [PROGRAM, "deck"],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=SECONDS,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
            check=False,
        )
        moves = _displacements(folder / "deck.dat", len(self.nodes))
        if "*ERROR" in done.stdout or len(moves) < len(self.targets):
            raise ConvergenceError(
                "CalculiX", f"{len(moves)} of {len(self.targets)} steps: {done.stdout[-500:]}"
            )
        return [self.nodes + move for move in moves]

    def _materials(self) -> Iterator[str]:
        """Sets of elements of the same moduli, each with its material."""
        kinds, kind = np.unique(np.column_stack(self.moduli), axis=0, return_inverse=True)
        for number, (mu, bulk) in enumerate(kinds.tolist()):
            yield f"*ELSET, ELSET=PART{number}"
            yield from _listed(np.flatnonzero(np.ravel(kind) == number) + 1)
            yield f"*MATERIAL, NAME=TISSUE{number}"
            yield "*HYPERELASTIC, NEO HOOKE"
            yield _numbers((mu / 2, 2 / bulk))
            yield f"*SOLID SECTION, ELSET=PART{number}, MATERIAL=TISSUE{number}"

    def _contact(self) -> Iterator[str]:
        """Contact between faces, with a pressure proportional to how far they overlap."""
        if self.touching is None:
            return
        for name, faces in zip(("FIRST", "SECOND"), self.touching, strict=True):
            yield f"*SURFACE, NAME={name}, TYPE=ELEMENT"
            yield from (f"{cell + 1}, S{ITS_SIDES[corner]}" for cell, corner in faces.tolist())
        yield from ("*SURFACE INTERACTION, NAME=TOUCH", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR")
        yield f"{CONTACT_STIFFNESS}, 0."
        yield from ("*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE", "SECOND, FIRST")

    def _step(self, target: Array) -> Iterator[str]:
        """One static step with large displacements."""
        nodes = np.flatnonzero(self.prescribed)
        yield from ("*STEP, NLGEOM, INC=1000", "*STATIC", f"{INCREMENT}, 1., 1.e-4, 1.", *CONTROLS)
        yield "*BOUNDARY"
        for node, move in zip((nodes + 1).tolist(), (target - self.nodes)[nodes].tolist(), strict=True):
            yield from (f"{node}, {k}, {k}, {value:{NUMBER}}" for k, value in enumerate(move, start=1))
        yield from ("*NODE PRINT, NSET=ALL, FREQUENCY=1000", "U", "*END STEP")


def _listed(numbers: IntArray) -> Iterator[str]:
    for first in range(0, len(numbers), A_LINE):
        yield ", ".join(map(str, numbers[first : first + A_LINE].tolist()))


def _numbers(values: Iterable[float]) -> str:
    return ", ".join(f"{value:{NUMBER}}" for value in values)


def _displacements(path: Path, count: int) -> list[Array]:
    """Displacements (n, 3) by step, in the order of nodes, from the table that CalculiX prints."""
    rows = [line.split() for line in path.read_text().splitlines() if line.strip()] if path.exists() else []
    table = np.array([row for row in rows if len(row) == 4 and row[0].isdigit()], dtype=float)
    steps = table.reshape(-1, count, 4) if len(table) % count == 0 else np.zeros((0, count, 4))
    return [step[np.argsort(step[:, 0]), 1:] for step in steps]
