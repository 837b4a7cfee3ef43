"""One edit of curves: what has changed is placed and solved for, surfaces and faults follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.anatomy.editing.curve_faults import CurveFaults
from handpipe.anatomy.editing.envelope_surfaces import envelope_surfaces
from handpipe.anatomy.editing.kept_functions import KeptFunctions
from handpipe.anatomy.templates.curves import CurveFile, MuscleCurves, PlacedMuscle, place
from handpipe.anatomy.templates.diffusion import Factorise, Functions, superlu
from handpipe.anatomy.templates.domain import Domain
from handpipe.anatomy.templates.tissue_mesh import crossings
from handpipe.core import InputError
from handpipe.core.configuration import Vector
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import Locator


@dataclass(frozen=True, eq=False)
class Edited:
    """Muscles after an edit.

    Parameters
    ----------
    muscles : dict of str to PlacedMuscle
        Curves and attachments in mm.
    functions : Functions
        Tissue functions of the fat and of the muscles that lie in the domain.
    surfaces : dict of str to Surface
        Surfaces of the muscles that are somewhere the largest tissue, for display.
    faults : tuple of InputError
        What has to be changed before tets can be made.
    warnings : tuple of str
        What a person should know of the curves, although it is no fault.
    """

    muscles: dict[str, PlacedMuscle]
    functions: Functions
    surfaces: dict[str, Surface]
    faults: tuple[InputError, ...]
    warnings: tuple[str, ...]


class CurveEditor:
    """Muscles of a file of curves that a person changes step by step.

    The domain is factorised once. The `edge_length` of muscles is not followed before tets are made.

    Parameters
    ----------
    domain : Domain
        Tets between skin and bones.
    skin : Surface
        Closed surface in mm.
    bones : mapping of str to Surface
        Surfaces in mm by bone.
    factorise : callable
        Factors symmetric positive definite matrices, see `superlu`.
    source : path
        The file, for messages.
    """

    def __init__(
        self,
        domain: Domain,
        skin: Surface,
        bones: Mapping[str, Surface],
        *,
        factorise: Factorise = superlu,
        source: str | Path = "curves",
    ) -> None:
        self.domain, self.bones, self.source = domain, bones, source
        self._functions = KeptFunctions(domain, factorise=factorise)
        self._faults = CurveFaults(skin, bones, source)
        self._locator = Locator(domain.mesh)
        self._edge = domain.edge_length()
        self._placed: dict[str, tuple[MuscleCurves, Vector, PlacedMuscle]] = {}

    def edit(self, file: CurveFile) -> Edited:
        """The muscles of a file; only those that differ from the call before are placed and drawn anew.

        Parameters
        ----------
        file : CurveFile
            All muscles as curves, and the fat.

        Returns
        -------
        Edited

        Raises
        ------
        InputError
            For a point that has no place, as `place` says. The editor stays as it was.
        """
        muscles = self._place(file)
        faults = self._faults.of(muscles)
        inside = {name: muscle for name, muscle in muscles.items() if self._is_inside(muscle)}
        functions = self._functions.of(inside, file.fat)
        surfaces = envelope_surfaces(self.domain.mesh, functions)
        faults += [self._nowhere(name, name in inside) for name in muscles if name not in surfaces]
        if not faults:
            faults = self._of_extents(muscles, functions, surfaces)
        warnings = self._faults.doubts(muscles) + crossings(muscles, self._edge)
        return Edited(muscles, functions, surfaces, tuple(faults), tuple(warnings))

    def _place(self, file: CurveFile) -> dict[str, PlacedMuscle]:
        kept = {
            name: self._placed[name]
            for name, muscle in file.muscles.items()
            if name in self._placed and self._placed[name][:2] == (muscle, file.distal)
        }
        changed = {name: muscle for name, muscle in file.muscles.items() if name not in kept}
        new = place(file.model_copy(update={"muscles": changed}), self.bones, self._edge / 4, self.source)
        kept |= {name: (changed[name], file.distal, muscle) for name, muscle in new.items()}
        self._placed = {name: kept[name] for name in file.muscles}
        return {name: muscle for name, (_, _, muscle) in self._placed.items()}

    def _of_extents(
        self, muscles: Mapping[str, PlacedMuscle], functions: Functions, surfaces: Mapping[str, Surface]
    ) -> list[InputError]:
        vertices, labels = self.domain.mesh.vertices, functions.values.argmax(axis=1)
        found = []
        for label, name in enumerate(functions.names[1:], start=1):
            points = np.concatenate([vertices[labels == label], surfaces[name].vertices])
            found += self._faults.of_extent(name, muscles[name], points, self._edge)
        return found

    def _is_inside(self, muscle: PlacedMuscle) -> bool:
        return any((self._locator.tets(curve.points) >= 0).any() for curve in muscle.curves)

    def _nowhere(self, name: str, inside: bool) -> InputError:
        field = f"muscles.{name}"
        if inside:
            return InputError(self.source, field, "is nowhere the largest tissue", "Raise `tissue`")
        problem = "no part of it lies between skin and bones"
        return InputError(self.source, f"{field}.curves", problem, "Move its points into the soft tissue")
