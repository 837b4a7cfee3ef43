"""The shape of an organ from sparse marks: a template and marks in, fitted mesh and strains out."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handpipe import artifacts
from handpipe.errors import InputError
from handpipe.fem import plasticity
from handpipe.fem.potential import Potential
from handpipe.mesh.tetrahedra import TetMesh
from handpipe.metrics import Metrics
from handpipe.shapes.correspondence import Correspondence
from handpipe.shapes.fit import Attached
from handpipe.shapes.marks import BoundaryMarks, Pairs, with_landmarks
from handpipe.shapes.placement import placed
from handpipe.shapes.search import EARLY, GROWTH, FindMarks, Record, Search, Settings, State

Array = NDArray[np.float64]

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class OrganFit:
    """What `fit_organ` found.

    mesh: the template's tets on fitted vertices, in mm; strains (m, 6): plastic strains whose equilibrium it
    is; record: every step; kept (r,): marks that counted at the end; quality: errors and quality of elements.
    """

    mesh: TetMesh
    strains: Array
    record: list[Record]
    kept: NDArray[np.bool_]
    quality: Metrics

    def table(self) -> dict[str, list[Any]]:
        """The record by columns, for an artifact."""
        return artifacts.columns(self.record)


def fit_organ(
    template: TetMesh,
    marks: Array | None = None,
    *,
    attachments: Pairs | None = None,
    landmarks: Pairs | None = None,
    loads: Sequence[Potential] = (),
    settings: Settings | None = None,
) -> OrganFit:
    """Deform a template tet mesh to the marks of one organ in an image (003 chapter 5).

    marks (r, 3): points on the organ's boundary, in mm, without correspondence; attachments: points of the
    template that other organs hold, and where; landmarks: points of the template whose places in the image
    are known; loads: potentials that act on the organ besides. An organ that nothing holds is placed by its
    landmarks, or else by its marks. Raises `InputError` for input that cannot be used, `ConvergenceError`
    where no equilibrium is found at the start.
    """
    settings = settings or Settings()
    template = template.checked("template")
    points = _checked_marks(marks)
    if len(points) == 0 and landmarks is None and attachments is None:
        raise InputError("organ", "marks", "there are none", "Give marks, landmarks or attachments")
    held = None if attachments is None else attachments.checked("attachments").attached(template)
    known = None if landmarks is None else landmarks.checked("landmarks").attached(template)
    boundary = BoundaryMarks(
        template, points, settings.tangential, settings.mark_error if settings.outliers else None
    )
    search = Search(template, held, loads, settings)
    start = placed(template, [p for p in (known, held) if p is not None], boundary)
    state = _stages(search, search.begin(start), boundary, known)
    kept = boundary.weights(state.x) > 0
    return OrganFit(
        mesh=template.moved(state.x),
        strains=state.body.strains,
        record=search.record,
        kept=kept,
        quality=_quality(template, state, search.attached, known, boundary, kept, start),
    )


def _stages(search: Search, state: State, marks: BoundaryMarks, known: Attached | None) -> State:
    """Attachments, landmarks, marks: each over uniform strains first (003 section 5.4)."""
    settings, n = search.settings, len(state.x)
    nothing = Correspondence.none(n)
    if len(search.attached.targets):
        state = search.run(state, "attachments", lambda x: nothing, 1.0, True, EARLY)
    if known is not None:
        landmarks = with_landmarks(lambda x: nothing, known)
        state = search.run(state, "landmarks, uniform", landmarks, settings.alpha, True, EARLY)
        state = _growing(search, state, "landmarks", landmarks, EARLY)
    if len(marks.points):
        find = with_landmarks(marks, known)
        state = search.run(state, "marks, uniform", find, settings.alpha, True, settings.iterations)
        state = _growing(search, state, "marks", find, settings.iterations)
    return state


def _growing(search: Search, state: State, stage: str, find: FindMarks, most: int) -> State:
    for share in GROWTH:
        steps = most if share == 1.0 else EARLY
        state = search.run(state, stage, find, share * search.settings.alpha, False, steps)
    return state


def _checked_marks(marks: Array | None) -> Array:
    points = np.zeros((0, 3)) if marks is None else np.asarray(marks, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError("marks", "points", f"have the shape {points.shape}", "Give points (r, 3) in mm")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise InputError("marks", f"point {bad[0]}", "NaN or infinite coordinates", "Place or remove it")
    return points


def _quality(
    template: TetMesh,
    state: State,
    held: Attached,
    known: Attached | None,
    marks: BoundaryMarks,
    kept: NDArray[np.bool_],
    start: Array,
) -> Metrics:
    """Errors in mm at marks, landmarks and attachments, and what has become of the elements."""
    fitted = template.moved(state.x)
    eigenvalues = plasticity.eigenvalues(state.body.strains)
    found: Metrics = {
        "smallest_dihedral_before": (template.smallest_dihedral(), "deg"),
        "smallest_dihedral_after": (fitted.smallest_dihedral(), "deg"),
        "inverted_tets": (float((fitted.volumes() <= 0).sum()), "1"),
        "eigenvalue_min": (float(eigenvalues.min()), "1"),
        "eigenvalue_max": (float(eigenvalues.max()), "1"),
        "volume_before": (float(template.volumes().sum()), "mm3"),
        "volume_after": (float(fitted.volumes().sum()), "mm3"),
    }
    if len(marks.points):
        found |= _errors("marks_start", marks.distances(start)[kept])
        found |= _errors("marks", marks.distances(state.x)[kept])
        found["marks_left_out"] = (float((~kept).sum()), "1")
    for name, pairs in (("attachments", held), ("landmarks", known)):
        if pairs is not None and len(pairs.targets):
            found |= _errors(name, np.linalg.norm(pairs.errors(state.x), axis=1))
    return found


def _errors(name: str, distances: Array) -> Metrics:
    mean = float(distances.mean()) if len(distances) else 0.0
    return {f"{name}_mean": (mean, "mm"), f"{name}_max": (float(distances.max(initial=0.0)), "mm")}
