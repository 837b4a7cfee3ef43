"""An initial guess at which no body intersects another: muscles deflated and pushed out of bones."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from handpipe.core import Array, ConvergenceError, IntArray
from handpipe.fem.solver import largest
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.tissues.muscles.separation.deflation import Deflation
from handpipe.tissues.muscles.separation.overlap import Collider, crossing, folds, meet

log = logging.getLogger(__name__)

FIRST_MARGIN = 0.05  # mm, first margin between a muscle and a bone
MARGIN_GROWTH = 1.5  # growth of the margin in each further round: bones reach through large triangles
LARGEST_MARGIN = 2.0  # mm
ROUNDS = 60  # at most
UNFOLDING = 60  # further rounds, at most, in which muscles unfold and come apart again
MOST_PUSHES = 5  # of two fully deflated muscles, before they are smoothed farther
DEPTHS = (
    0.3,
    1.0,
)  # mm, largest penetration that a push resolves: deeper, its direction may be wrong
LARGEST_MOTION = 8.0  # mm of a vertex: from farther away, muscles hardly grow back to their places
SHORT_STEP, MOST_STEPS = 0.05, 40  # mm and 1: way out of a bone in one step, and number of steps


class Inseparable(ConvergenceError):
    """Muscles intersect however deflated: their attachments are inside one another, or cross."""


def body_pairs(muscles: Sequence[Collider], bones: Sequence[Collider]) -> list[tuple[int, int]]:
    """Pairs of muscle and muscle, or muscle and bone, as indices into muscles followed by bones."""
    m, b = len(muscles), len(bones)
    return [*combinations(range(m), 2), *((i, m + j) for i in range(m) for j in range(b))]


def disjoint_start(muscles: Sequence[Collider], bones: Sequence[Collider]) -> list[Array] | None:
    """Vertices (n, 3) of each muscle at which no bodies intersect; None if none intersect at rest.

    Where muscles have to move far, a second attempt resolves deeper penetrations by pushes. The result that
    moves less is returned.

    Raises
    ------
    Inseparable
        If a pair of bodies intersects however deflated; the message names it.
    """
    best, least, problem = None, np.inf, None
    for deepest in DEPTHS:
        try:
            found = _deflated(muscles, bones, deepest)
        except Inseparable as error:
            log.info("separation: %s", error)
            problem = error
            continue
        if found is None:
            return None
        moved = max(largest(x - body.surface.vertices) for x, body in zip(found, muscles, strict=True))
        log.info("separation: disjoint initial guess found; largest motion of a vertex %.1f mm", moved)
        if moved < least:
            best, least = found, moved
        if least <= LARGEST_MOTION:
            break
    if best is None and problem is not None:
        raise problem
    return best


def _deflated(muscles: Sequence[Collider], bones: Sequence[Collider], deepest: float) -> list[Array] | None:
    """One attempt of `disjoint_start`: pushes resolve penetrations up to `deepest` mm.

    Deflated muscles that cut themselves would keep their folds while they grow back: they are deflated
    further. Where that leads nowhere, the bodies with the fewest folds serve that are apart from one another.
    """
    deflating = _Deflating(muscles, bones, deepest)
    pair = deflating.part(ROUNDS)
    if not deflating.rounds:
        return None
    if pair:
        raise Inseparable("Separation of muscles", f"{pair} intersect even when deflated to threads")
    best, least, most = deflating.places(), np.inf, deflating.rounds + UNFOLDING
    while not pair:
        folded = deflating.folds()
        count = sum(map(len, folded.values()))
        if count < least:
            best, least = deflating.places(), count
        if not folded or deflating.rounds >= most:
            break
        log.info("separation: muscles that cut themselves: %s", ", ".join(muscles[i].name for i in folded))
        deflating.unfold(folded)
        pair = deflating.part(most)
    return best


class _Deflating:
    """Muscles at their present places among bones, and how each comes away from the others."""

    def __init__(self, muscles: Sequence[Collider], bones: Sequence[Collider], deepest: float) -> None:
        self._count, self._bodies = len(muscles), [*muscles, *bones]
        self._starts = [_Start(body, self._bodies, deepest) for body in muscles]
        self._at = [body.surface for body in self._bodies]
        self._pairs = self._open = body_pairs(muscles, bones)
        self.rounds = 0  # in which muscles moved

    def places(self) -> list[Array]:
        """Vertices (n, 3) of each muscle."""
        return [surface.vertices for surface in self._at[: self._count]]

    def _meeting(self) -> list[tuple[int, int]]:
        """Pairs of bodies that intersect, of those that moved since they were found apart."""
        bodies, at = self._bodies, self._at
        return [(i, j) for i, j in self._open if meet(bodies[i], bodies[j], at[i], at[j])]

    def part(self, most: int) -> str:
        """Move muscles until no bodies intersect; two that still do when so many rounds are made, by name."""
        pair = ""
        while self.rounds < most:
            meeting = self._meeting()
            if not meeting:
                self._open = []
                return ""
            pair = " and ".join(self._bodies[k].name for k in meeting[0])
            log.info("separation: %d pairs of bodies intersect, among them %s", len(meeting), pair)
            both = [*meeting, *((j, i) for i, j in meeting if j < self._count)]
            for i, j in both:
                self._starts[i].yield_to(j, self._at[i], self._at[j])
            self._move({i for i, _ in both})
        return pair

    def folds(self) -> dict[int, IntArray]:
        """Vertices of each muscle's folds, where it has some."""
        found = {i: folds(surface) for i, surface in enumerate(self._at[: self._count])}
        return {i: vertices for i, vertices in found.items() if len(vertices)}

    def unfold(self, folded: Mapping[int, IntArray]) -> None:
        """Deflate muscles further around their vertices."""
        for i, vertices in folded.items():
            self._starts[i].unfold(vertices)
        self._move(set(folded))

    def _move(self, moved: set[int]) -> None:
        self.rounds += 1
        for i in moved:
            self._at[i] = self._at[i].moved(self._starts[i].vertices())
        self._open = [(i, j) for i, j in self._pairs if i in moved or j in moved]


class _Start:
    """The state of one muscle: deflated away from other muscles, pushed out of bones.

    A fully deflated muscle that still intersects another is pushed a few times before it is smoothed:
    smoothing straightens a bent muscle and can move it deeper into a body that lies in its bend. Where only
    edges cut, no push direction is known, and the muscle is smoothed at once.
    """

    def __init__(self, body: Collider, bodies: Sequence[Collider], deepest: float) -> None:
        self._body, self._bodies, self._deepest = body, bodies, deepest
        self._margins = np.zeros(len(bodies))  # mm from each bone; zero: not pushed
        self._intersecting = np.zeros(
            len(body.surface.vertices), dtype=bool
        )  # vertices that intersect muscles
        self._directions = np.zeros_like(body.surface.vertices)  # in mm, out of muscles
        self._deflation: Deflation | None = None
        self._push, self._pushes = np.zeros_like(body.surface.vertices), 0
        self._astray = False  # whether only edges cut a muscle: then no direction out is known
        self._folded = False  # whether it has cut itself
        self._distances: dict[int, Distance] = {}

    def yield_to(self, j: int, here: Surface, there: Surface) -> None:
        """Record that this muscle, at its current place, intersects body j."""
        body, x = self._bodies[j], here.vertices
        if body.fixed and not self._folded:
            self._leave(j, x)
            return
        gaps, _, _, normals = Distance(there).signed(x)
        # Near inverted parts of a body the sign by normals is wrong far outside it: winding numbers confirm.
        meeting = gaps < 0
        meeting[meeting] = there.contains(x[meeting])
        if not meeting.any():
            meeting[crossing(self._body, body, x, there.vertices)] = True
            self._astray |= not here.contains(there.vertices).any()
        if not meeting.any():
            meeting = gaps <= 1.5 * gaps.min()
        self._intersecting |= meeting
        self._directions[meeting] += ((FIRST_MARGIN + 0.5 * np.maximum(-gaps, 0.0))[:, None] * normals)[
            meeting
        ]

    def unfold(self, vertices: IntArray) -> None:
        """Record that this muscle cuts itself at vertices (k,).

        From now on it leaves bones as it leaves muscles: vertex by vertex pushed out of a bone, both sides of
        a thin muscle come to one place.
        """
        self._folded, self._margins[:] = True, 0.0
        self._intersecting[vertices] = self._astray = True

    def _leave(self, j: int, x: Array) -> None:
        """Record that this muscle at x (n, 3) intersects bone j, and increase the margin from it.

        Where another bone has pushed the muscle back there is no room between the two bones: then it is
        deflated, as at a muscle.
        """
        free, been_out = self._body.free, self._margins[j] > 0.0
        back = free[self._outside(j).signed(x[free])[0] < 0] if been_out else free[:0]
        if not len(back):
            self._margins[j] = min(max(FIRST_MARGIN, MARGIN_GROWTH * self._margins[j]), LARGEST_MARGIN)
            return
        self._margins[self._margins > 0] = FIRST_MARGIN
        self._intersecting[back] = self._astray = True

    def _outside(self, j: int) -> Distance:
        """The distance from bone j."""
        if j not in self._distances:
            self._distances[j] = Distance(self._bodies[j].surface)
        return self._distances[j]

    def vertices(self) -> Array:
        """Vertices (n, 3) after one more step away from the bodies recorded since the last one."""
        if self._intersecting.any():
            self._step()
        x = self._deflation.vertices() if self._deflation else self._body.surface.vertices
        x = x + self._push
        # Attached vertices stay: springs that pull them back would drag free ones into other bodies.
        x[self._body.attached] = self._body.surface.vertices[self._body.attached]
        free = self._body.free
        for j in map(int, np.flatnonzero(self._margins)):
            x[free] = _pushed_out(x[free], self._outside(j), self._margins[j])
        return x

    def _step(self) -> None:
        """Take a step away from the recorded muscles."""
        self._deflation = self._deflation or Deflation(self._body.surface)
        meeting = np.flatnonzero(self._intersecting)
        directions = self._directions[meeting]
        self._intersecting[:], self._directions[:] = False, 0.0
        shallow = np.linalg.norm(directions, axis=1).max() <= FIRST_MARGIN + 0.5 * self._deepest
        astray, self._astray = self._astray, False
        if shallow and not astray and self._pushes < MOST_PUSHES and self._deflation.thin(meeting):
            self._push = self._push + self._deflation.pushed(meeting, directions)
            self._pushes += 1
        else:
            self._deflation.step(meeting)
            self._pushes = 0


def _pushed_out(points: Array, bone: Distance, margin: float) -> Array:
    """Points (n, 3) moved out of a bone, to a margin in mm where there is room for it.

    Outside the bone the steps are short: across a hollow, a long step would end in the opposite wall.
    """
    x, near = points.copy(), np.arange(len(points))
    for _ in range(MOST_STEPS):
        gaps, _, _, normals = bone.signed(x[near])
        short = gaps < margin - 1e-9
        near, gaps, normals = near[short], gaps[short], normals[short]
        if not len(near):
            break
        steps = np.minimum(margin - gaps, np.maximum(-gaps, 0.0) + SHORT_STEP)
        x[near] += steps[:, None] * normals
    return x
