"""The shape of an organ from sparse marks: a template and marks in, fitted mesh and strains out."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handpipe.core import Array, BoolArray, InputError, Metrics, artifacts
from handpipe.fem.elements import plasticity
from handpipe.fem.potentials import Potential
from handpipe.imaging.volumes import Volume
from handpipe.mesh.tets import TetMesh
from handpipe.shapes.observations.given_frame import Sources, require_in_image, require_reached, require_sizes
from handpipe.shapes.observations.marks import BoundaryMarks, Pairs
from handpipe.shapes.observations.placement import placed
from handpipe.shapes.observations.straight import loosened, on_line
from handpipe.shapes.optimisation.search import StepRecord
from handpipe.shapes.optimisation.settings import OrganSettings
from handpipe.shapes.optimisation.strain_space import State
from handpipe.shapes.organs.buckling import bend
from handpipe.shapes.organs.doubts import Doubts, examine
from handpipe.shapes.organs.remeshing import Given, OnMesh
from handpipe.shapes.organs.resume import FitCheckpoint
from handpipe.shapes.organs.stages import NEW_TETS, FitPosition, follow, plan

log = logging.getLogger(__name__)

REMEDY = "Give attachments at both ends, or points between, and look at the shape"
MISSED = 0.03  # of the organ's size, between a pair of points that a fit has not brought together


@dataclass(frozen=True)
class OrganFit:
    """Fitted organ, its plastic strains and the quality of the fit.

    Parameters
    ----------
    mesh : TetMesh
        Fitted organ in mm.
    rest : TetMesh
        The same tets at rest: on the template's vertices or, if the organ was remeshed, on those of its shape
        at the last remeshing.
    strains : array (m, 6)
        Plastic strains from `rest`, under which the fitted organ is the equilibrium.
    carried : array (n0, 3)
        Positions in mm of the template's vertices in the fitted organ.
    record : list of StepRecord
        Every step.
    kept : boolean array (r,)
        Mask of the marks with a weight above zero at the end.
    doubtful : boolean array (t,)
        Mask of the attachments that were not used, since other points contradict them.
    quality : Metrics
        Errors in mm and the quality of elements.
    """

    mesh: TetMesh
    rest: TetMesh
    strains: Array
    carried: Array
    record: list[StepRecord]
    kept: BoolArray
    doubtful: BoolArray
    quality: Metrics

    def table(self) -> dict[str, list[Any]]:
        """The record by columns, for an artifact."""
        return artifacts.columns(self.record)


@dataclass(frozen=True)
class Observed:
    """Observations of an organ in an image; at least one kind is given.

    Parameters
    ----------
    marks : array (r, 3), optional
        Points on its boundary in mm, without correspondence.
    attachments : Pairs, optional
        Points of the template that are attached to other organs, and their places in the image.
    landmarks : Pairs, optional
        Points of the template whose places in the image are known.
    volume : Volume, optional
        Image that is searched for marks along the surface's normals in the last stage.
    """

    marks: Array | None = None
    attachments: Pairs | None = None
    landmarks: Pairs | None = None
    volume: Volume | None = None


def fit_organ(
    template: TetMesh,
    observed: Observed,
    *,
    loads: Sequence[Potential] = (),
    settings: OrganSettings | None = None,
    checkpoint: str | Path | None = None,
    sources: Sources | None = None,
) -> OrganFit:
    """Shape of an organ in an image: a template tet mesh deformed to match marks.

    An organ without attachments is placed by its landmarks, or else by its marks, or else it begins at the
    template's place. Badly shaped tets are replaced (`remeshing.py`).

    Parameters
    ----------
    template : TetMesh
        Organ at rest in mm.
    observed : Observed
        Marks, attachments, landmarks and image.
    loads : sequence of Potential
        Further potentials that act on the organ.
    settings : OrganSettings, optional
        Weights and stopping criteria.
    checkpoint : path, optional
        File that is written after every step and removed at the end; an interrupted fit of the same input
        continues from it.
    sources : Sources, optional
        Names of the inputs in errors.

    Returns
    -------
    OrganFit
        Fitted mesh in mm, plastic strains, every step and the quality of the fit.

    Raises
    ------
    InputError
        If the input is unusable: no observations, misshapen or not finite points, points off the template,
        another unit, or an organ outside of the image.
    ConvergenceError
        If no equilibrium is found at the start.

    References
    ----------
    Wang 2021 chapter 5.
    """
    settings = settings or OrganSettings()
    sources = sources or Sources()
    template = template.checked(sources.template)
    points = _checked_marks(observed.marks)
    attachments, landmarks, volume = observed.attachments, observed.landmarks, observed.volume
    if len(points) == 0 and landmarks is None and attachments is None and volume is None:
        raise InputError("organ", "marks", "there are none", "Give marks, landmarks, attachments or a volume")
    attachments = None if attachments is None else attachments.checked("attachments")
    landmarks = None if landmarks is None else landmarks.checked("landmarks")
    named = {sources.attachments: attachments, sources.landmarks: landmarks}
    require_sizes(template, points, {name: p for name, p in named.items() if p is not None}, sources)
    attachments, landmarks = loosened(attachments, landmarks)
    attached = None if attachments is None else attachments.attached(template)
    known = None if landmarks is None else landmarks.attached(template)
    given = Given(template, points, attached, known, tuple(loads), volume, settings)
    start = _start(given)
    require_reached(template.moved(start), points, settings.outliers, sources)
    if volume is not None:
        require_in_image(template.moved(start), volume, sources)
    doubts = examine(given, start)
    given = doubts.heeded(given)
    if doubts.attachments.any():
        start = _start(given)
    task = OnMesh.of_template(given)
    file = None if checkpoint is None else FitCheckpoint(checkpoint, given)
    position = None if file is None else file.read()
    if position is None:
        position = FitPosition(task, task.search.begin(task.attachments, start))
    position = follow(position, plan(given), lambda p: None if file is None else file.write(p))
    if file is not None:
        file.done()
    return _finished(position, task.marks, start, doubts)


def _start(given: Given) -> Array:
    pairs = [p for p in (given.known, given.attached) if p is not None]
    return placed(given.template, pairs, OnMesh.of_template(given).marks)


def _finished(position: FitPosition, template_marks: BoundaryMarks, start: Array, doubts: Doubts) -> OrganFit:
    task, state = position.task, position.state
    kept = task.marks.weights(state.x) > 0
    quality = _quality(task, state, kept, template_marks.distances(start)) | doubts.quality()
    held = task.attachments.targets
    bent = bend(task.search, state) if len(held) >= 3 and on_line(held) else None
    if bent is not None:
        quality["attachments_bend"] = (bent, "mm")
    _warn_of_misses(quality, float(np.ptp(state.x, axis=0).max()))
    return OrganFit(
        mesh=task.mesh.moved(state.x),
        rest=task.mesh,
        strains=state.body.strains,
        carried=task.carry @ state.x,
        record=task.search.record,
        kept=kept,
        doubtful=doubts.attachments,
        quality=quality,
    )


def _checked_marks(marks: Array | None) -> Array:
    points = np.zeros((0, 3)) if marks is None else np.asarray(marks, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError("marks", "points", f"have the shape {points.shape}", "Give points (r, 3) in mm")
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise InputError("marks", f"point {bad[0]}", "NaN or infinite coordinates", "Place or remove it")
    return points


def _quality(task: OnMesh, state: State, kept: BoolArray, before: Array) -> Metrics:
    """Errors in mm at marks, landmarks and attachments, and the quality of the elements.

    `before` are the errors at the marks at the start.
    """
    template, fitted = task.given.template, task.mesh.moved(state.x)
    eigenvalues = plasticity.eigenvalues(state.body.strains)
    found: Metrics = {
        "smallest_dihedral_before": (template.smallest_dihedral(), "deg"),
        "smallest_dihedral_after": (fitted.smallest_dihedral(), "deg"),
        "inverted_tets": (float((fitted.volumes() <= 0).sum()), "1"),
        "new_meshes": (float(sum(r.stage == NEW_TETS for r in task.search.record)), "1"),
        "tets": (float(len(fitted.tets)), "1"),
        "eigenvalue_min": (float(eigenvalues.min()), "1"),
        "eigenvalue_max": (float(eigenvalues.max()), "1"),
        "volume_before": (float(template.volumes().sum()), "mm3"),
        "volume_after": (float(fitted.volumes().sum()), "mm3"),
    }
    if len(kept):
        found |= _errors("marks_start", before[kept])
        found |= _errors("marks", task.marks.distances(state.x)[kept])
        found["marks_left_out"] = (float((~kept).sum()), "1")
    if task.image is not None:
        edges = task.image(state.x)
        found |= _errors("image_marks", edges.distances(state.x))
        found["image_marks"] = (float(edges.count), "1")
    for name, pairs in (("attachments", task.attachments), ("landmarks", task.known)):
        if pairs is not None and len(pairs.targets):
            found |= _errors(name, np.linalg.norm(pairs.errors(state.x), axis=1))
    return found


def _warn_of_misses(quality: Metrics, size: float) -> None:
    """Warn where pairs of points are still apart, relative to the size of the organ in mm."""
    for name in ("landmarks", "attachments"):
        apart = quality.get(f"{name}_max", (0.0, "mm"))[0]
        if apart > MISSED * size:
            text = "%s are still up to %.3g mm apart (limit %.3g mm): the search has not converged. %s"
            log.warning(text, name, apart, MISSED * size, REMEDY)


def _errors(name: str, distances: Array) -> Metrics:
    mean = float(distances.mean()) if len(distances) else 0.0
    return {f"{name}_mean": (mean, "mm"), f"{name}_max": (float(distances.max(initial=0.0)), "mm")}
