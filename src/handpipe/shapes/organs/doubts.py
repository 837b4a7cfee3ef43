"""Attachments that the other points contradict, and marks that contradict each other.

Predictions of points from the others (`predictions.py`) show both before the search begins, which would
match all points: one wrong attachment by a spike, many wrong marks by strains that invert tets.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np

from handpipe.core import Array, BoolArray, IntArray, Metrics, RigidTransform, robust
from handpipe.shapes.observations.attached import Attached
from handpipe.shapes.observations.attachment_targets import AttachmentTargets
from handpipe.shapes.observations.marks import BoundaryMarks
from handpipe.shapes.optimisation.all_tets import AllTets
from handpipe.shapes.optimisation.search import Search
from handpipe.shapes.optimisation.strain_space import FindMarks, Stage
from handpipe.shapes.organs.coarse_template import coarsened
from handpipe.shapes.organs.predictions import Predictions, all_points
from handpipe.shapes.organs.remeshing import EARLY, Given

log = logging.getLogger(__name__)

SMOOTH = 0.01  # share of the marks' weight in a smooth fit, which follows each point's own error little
SUSPECT = 2.0  # scales beyond which an attachment has no part in it
SHARES = 10.0 ** -np.arange(5)  # of the marks' weight that are tried
SAMPLE = 200  # marks that are compared with each other
GROUP = 50  # attachments that are compared at a time
CLEARLY = 0.9  # of the marks' error: a lower weight must reduce it to this


@dataclass(frozen=True)
class Doubts:
    """Attachments and marks that other points contradict.

    attachments (t,): mask of contradicted attachments; scatter: mean distance in mm of marks from the places
    that other points predict; outlying: share of marks whose distance is far beyond the others'; share: of
    the weight alpha, with which marks predict each other best.
    """

    attachments: BoolArray
    scatter: float = 0.0
    outlying: float = 0.0
    share: float = 1.0

    def heeded(self, given: Given) -> Given:
        """The same without doubtful attachments, and marks with the share of their weight."""
        attached, settings = given.attached, replace(given.settings, alpha=self.share * given.settings.alpha)
        if attached is not None and self.attachments.any():
            attached = attached.chosen(np.flatnonzero(~self.attachments))
        return replace(given, attached=attached, settings=settings)

    def quality(self) -> Metrics:
        """For people."""
        return {
            "attachments_doubtful": (float(self.attachments.sum()), "1"),
            "marks_scatter": (self.scatter, "mm"),
            "marks_outlying": (self.outlying, "1"),
            "marks_weight": (self.share, "1"),
        }

    def tell(self) -> None:
        """Log a warning for each doubt."""
        if self.attachments.any():
            which = np.flatnonzero(self.attachments).tolist()
            log.warning("attachments %s are left out: other points contradict them", which)
        if self.outlying > 0:
            log.warning("%.0f %% of the marks are far from all others", 100 * self.outlying)
        if self.share < 1:
            log.warning("marks contradict each other by %.2f mm and count %g times", self.scatter, self.share)


def examine(given: Given, start: Array) -> Doubts:
    """Compare attachments and marks with predictions of the others, from vertices (n, 3) placed rigidly.

    Few tets suffice for that (`coarse_template.py`); marks are compared with the template's own surface,
    which they carry.

    Raises
    ------
    ConvergenceError
        If no equilibrium is found at the start.
    """
    count = 0 if given.attached is None else len(given.attached.targets)
    doubts = Doubts(np.zeros(count, dtype=bool))
    if count < 2 and len(given.marks) < 2:
        return doubts
    body = _Body.measure(given, start)
    for first in range(max(-(-count // GROUP), 1)):
        chosen = np.arange(first, count, max(-(-count // GROUP), 1))
        examination = _Examination(given, body, chosen)
        doubts.attachments[chosen] = examination.contradicted()
        if first == 0:
            doubts = Doubts(doubts.attachments, *examination.agreement())
    doubts.tell()
    return doubts


@dataclass(frozen=True)
class _Body:
    """The free body that is fitted.

    It has strains, their search, vertices placed rigidly, no attachments, and points that it carries.
    """

    space: AllTets
    search: Search
    start: Array
    attachments: AttachmentTargets
    marks: FindMarks
    known: Attached | None
    attached: Attached

    @staticmethod
    def measure(given: Given, placed: Array) -> _Body:
        settings = given.settings
        mesh, carry = coarsened(given.template)
        robust = settings.mark_error if settings.outliers else None
        marks = BoundaryMarks(given.template, given.marks, settings.tangential, robust).thinned(SAMPLE)
        attached = given.attached or Attached.nothing(len(placed))
        space = AllTets(mesh.tets, settings)
        return _Body(
            space,
            Search(mesh, space, settings),
            RigidTransform.fit(given.template.vertices, placed)(mesh.vertices),
            AttachmentTargets.place(Attached.nothing(len(mesh.vertices)), (), mesh.vertices),
            lambda x: marks(carry @ x).carried(carry),
            None if given.known is None else given.known.carried(carry),
            attached.carried(carry),
        )


class _Examination:
    """Some of the attachments with all other points, of a free body at a smooth fit."""

    def __init__(self, given: Given, body: _Body, chosen: IntArray) -> None:
        self.given, self.settings = given, given.settings
        self.attached = body.attached.chosen(chosen)
        search, marks, known = body.search, body.marks, body.known
        alpha = given.settings.alpha
        find = all_points(marks, known, self.attached)
        state = search.begin(body.attachments, body.start)
        state = search.run(state, Stage("doubts, uniform", find, alpha, 1, EARLY))
        self.suspects = np.zeros(len(self.attached.targets), dtype=bool)
        if len(self.suspects):
            self.predictions = Predictions.at(body.space, state, marks, known, self.attached)
            self.suspects = self._suspects()
            find = all_points(marks, known, self.attached.chosen(np.flatnonzero(~self.suspects)))
        state = search.run(state, Stage("doubts", find, SMOOTH * alpha, None, EARLY))
        self.predictions = Predictions.at(body.space, state, marks, known, self.attached)

    def _suspects(self) -> BoolArray:
        """Attachments (t,) with large errors, the worst before the others, whose predictions it spoils."""
        wrong = np.zeros(len(self.attached.targets), dtype=bool)
        while (~wrong).sum() > 1:
            left = np.flatnonzero(~wrong)
            errors = np.linalg.norm(self._offsets(left, wrong), axis=1)
            worst = int(np.argmax(errors))
            if errors[worst] <= SUSPECT * self._usual(np.delete(errors, worst)):
                break
            wrong[left[worst]] = True
        return wrong

    def contradicted(self) -> BoolArray:
        """Attachments (t,) whose errors are far beyond the others'.

        These errors also exceed the distance of the nearest other point from where they should be: that is
        what displacements may differ by where strains are of order one. Suspects had no part in the fit, and
        have none in the predictions of others until they are found plausible: those next to trusted points
        come first, so that a whole end of suspects is reached from its neighbours.
        """
        found, trusted = self.suspects.copy(), np.flatnonzero(~self.suspects)
        most = robust.TUKEY * self._usual(np.linalg.norm(self._offsets(trusted, self.suspects), axis=1))
        while found.any():
            suspects = np.flatnonzero(found)
            cleared = [suspect for suspect in suspects if self._plausible(int(suspect), found, most)]
            if not cleared:
                break
            found[cleared] = False
        return found

    def _plausible(self, suspect: int, excluded: BoolArray, most: float) -> bool:
        """Whether an attachment is about where all others but the excluded ones (t,) predict it."""
        others = excluded.copy()
        others[suspect] = False
        offset = self._offsets(np.array([suspect]), others)[0]
        near = self.attached.targets[~excluded]
        room = self._distance(self.attached.targets[suspect] - offset, near)
        return bool(np.linalg.norm(offset) <= max(most, room))

    def _offsets(self, asked: IntArray, excluded: BoolArray) -> Array:
        """Offsets (k, 3) of attachments as all points but the excluded attachments (t,) predict them."""
        places = self.predictions.attachments
        among = np.setdiff1d(self.predictions.points, places[excluded])
        return self.predictions.errors(places[asked], among, SMOOTH * self.settings.alpha)

    def _usual(self, errors: Array) -> float:
        return max(robust.NORMAL * float(np.median(errors)), self.settings.mark_error)

    def _distance(self, place: Array, attachments: Array) -> float:
        """Of a place from the nearest mark, landmark or attachment (k, 3), in mm."""
        known = [] if self.given.known is None else [self.given.known.targets]
        points = np.concatenate([attachments, self.given.marks, *known])
        return float(np.linalg.norm(points - place, axis=1).min())

    def agreement(self) -> tuple[float, float, float]:
        """Scatter, outlying and share: that of the weight which makes the marks' errors least, if clearly."""
        marks, settings = self.predictions.marks, self.settings
        if len(marks) == 0:
            return 0.0, 0.0, 1.0
        among = np.setdiff1d(self.predictions.points, self.predictions.attachments[self.suspects])
        every = [self.predictions.errors(marks, among, s * settings.alpha) for s in SHARES]
        errors = np.linalg.norm(every, axis=2)
        means = errors.mean(axis=1)
        log.debug("marks' errors by weight: %s mm", np.round(means, 3))
        best = int(np.argmin(means))
        if means[0] <= settings.mark_error or means[best] > CLEARLY * means[0]:
            best = 0
        outlying = float((errors[best] > robust.TUKEY * self._usual(errors[best])).mean())
        return float(means[best]), outlying, float(SHARES[best])
