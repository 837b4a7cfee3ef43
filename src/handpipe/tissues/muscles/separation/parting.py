"""A start at which no body meets another: muscles drawn in from one another and pushed out of bones."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from handpipe.core import Array, ConvergenceError
from handpipe.fem.solver import largest
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.tissues.muscles.separation.deflation import Deflation
from handpipe.tissues.muscles.separation.overlap import Body, crossing, meet

log = logging.getLogger(__name__)

MARGIN = 0.05  # mm that a muscle is first kept out of a bone
WIDER = 1.5  # times as far in every further round: bones reach through large triangles
WIDEST = 2.0  # mm, at most
ROUNDS = 60
PUSHES = 5  # at two muscles that are thin, before they are smoothed farther
DEEPEST = (0.3, 1.0)  # mm, at most, out of which they are pushed: the nearest way out of more may be wrong
FAR = 8.0  # mm of a vertex: from farther muscles hardly grow back to their places
SHORT, STEPS = 0.05, 40  # mm outside of a bone that a vertex goes at once, and how often, on its way out


class Inseparable(ConvergenceError):
    """Muscles meet however deflated: their attachments are inside one another, or cross."""


def body_pairs(muscles: Sequence[Body], bones: Sequence[Body]) -> list[tuple[int, int]]:
    """Muscle and muscle, or muscle and bone: numbers in the list of both."""
    m, b = len(muscles), len(bones)
    return [*combinations(range(m), 2), *((i, m + j) for i in range(m) for j in range(b))]


def parted(muscles: Sequence[Body], bones: Sequence[Body]) -> list[Array] | None:
    """Vertices (n, 3) of each muscle at which nothing meets; None where that is so at rest.

    Where muscles move far for it, the nearer of two ways is taken: the second pushes out of greater depths.

    Raises
    ------
    Inseparable
        Where a pair, which it names, meets however deflated.
    """
    best, least, problem = None, np.inf, None
    for deepest in DEEPEST:
        try:
            found = _drawn_in(muscles, bones, deepest)
        except Inseparable as error:
            log.info("separation: %s", error)
            problem = error
            continue
        if found is None:
            return None
        moved = max(largest(x - body.surface.vertices) for x, body in zip(found, muscles, strict=True))
        log.info("separation: nothing meets once vertices have moved by %.1f mm at most", moved)
        if moved < least:
            best, least = found, moved
        if least <= FAR:
            break
    if best is None and problem is not None:
        raise problem
    return best


def _drawn_in(muscles: Sequence[Body], bones: Sequence[Body], deepest: float) -> list[Array] | None:
    """As `parted`, by one way."""
    bodies = [*muscles, *bones]
    starts = [_Start(b, bodies, deepest) for b in muscles]
    at = [b.surface for b in bodies]
    pairs = open_pairs = body_pairs(muscles, bones)
    for round_ in range(ROUNDS):
        meeting = [(i, j) for i, j in open_pairs if meet(bodies[i], bodies[j], at[i], at[j])]
        if not meeting:
            return [surface.vertices for surface in at[: len(muscles)]] if round_ else None
        names = " and ".join(bodies[k].name for k in meeting[0])
        log.info("separation: %d pairs of bodies meet, among them %s", len(meeting), names)
        both = [*meeting, *((j, i) for i, j in meeting if j < len(muscles))]
        for i, j in both:
            starts[i].give_way(j, at[i], at[j])
        moved = {i for i, _ in both}
        for i in moved:
            at[i] = at[i].moved(starts[i].vertices())
        open_pairs = [(i, j) for i, j in pairs if i in moved or j in moved]
    raise Inseparable("Separation of muscles", f"{names} meet even when drawn in to threads")


class _Start:
    """One muscle on its way to where it meets no other body: drawn in from muscles, pushed out of bones.

    Where it is thin and still meets a muscle both are pushed apart a few times before smoothing takes it
    back: that straightens what is bent, and may lead it deeper into what lies in its bend. Where edges alone
    cut, as corners do that are left behind and pass one another, pushes would lead them farther: they are
    smoothed at once.
    """

    def __init__(self, body: Body, bodies: Sequence[Body], deepest: float) -> None:
        self._body, self._bodies, self._deepest = body, bodies, deepest
        self._margins = np.zeros(len(bodies))  # mm by which it is kept out of a bone, zero if left alone
        self._meets = np.zeros(len(body.surface.vertices), dtype=bool)  # vertices that meet muscles
        self._ways = np.zeros_like(body.surface.vertices)  # in mm out of those that they meet
        self._deflation: Deflation | None = None
        self._push, self._pushes = np.zeros_like(body.surface.vertices), 0
        self._astray = False  # whether edges alone cut a muscle: then no way out is known
        self._distances: dict[int, Distance] = {}

    def give_way(self, j: int, here: Surface, there: Surface) -> None:
        """Note that this muscle, where it is now, meets body j."""
        body, x = self._bodies[j], here.vertices
        if body.fixed:
            self._leave(j, x)
            return
        gaps, _, _, normals = Distance(there).signed(x)
        # Of a body that is inside out in places, normals alone say that what is far outside is deep in it.
        meeting = gaps < 0
        meeting[meeting] = there.contains(x[meeting])
        if not meeting.any():
            meeting[crossing(self._body, body, x, there.vertices)] = True
            self._astray |= not here.contains(there.vertices).any()
        if not meeting.any():
            meeting = gaps <= 1.5 * gaps.min()
        self._meets |= meeting
        self._ways[meeting] += ((MARGIN + 0.5 * np.maximum(-gaps, 0.0))[:, None] * normals)[meeting]

    def _leave(self, j: int, x: Array) -> None:
        """Note that this muscle at x (n, 3) meets bone j: it is to be kept farther out of it.

        Where it has been pushed out and another bone has pushed it back there is no room between the two:
        then it gives way as to a muscle.
        """
        free, been_out = self._body.free, self._margins[j] > 0.0
        back = free[self._outside(j).signed(x[free])[0] < 0] if been_out else free[:0]
        if not len(back):
            self._margins[j] = min(max(MARGIN, WIDER * self._margins[j]), WIDEST)
            return
        self._margins[self._margins > 0] = MARGIN
        self._meets[back] = self._astray = True

    def _outside(self, j: int) -> Distance:
        """The distance from bone j."""
        if j not in self._distances:
            self._distances[j] = Distance(self._bodies[j].surface)
        return self._distances[j]

    def vertices(self) -> Array:
        """Vertices (n, 3) after one more step away from what was met since the last one."""
        if self._meets.any():
            self._step()
        x = self._deflation.vertices() if self._deflation else self._body.surface.vertices
        x = x + self._push
        # Held vertices stay: springs that pulled them back would drag free ones into other bodies.
        x[self._body.held] = self._body.surface.vertices[self._body.held]
        free = self._body.free
        for j in map(int, np.flatnonzero(self._margins)):
            x[free] = _kept_out(x[free], self._outside(j), self._margins[j])
        return x

    def _step(self) -> None:
        """Take a step away from the muscles that were met."""
        self._deflation = self._deflation or Deflation(self._body.surface)
        meeting = np.flatnonzero(self._meets)
        ways = self._ways[meeting]
        self._meets[:], self._ways[:] = False, 0.0
        shallow = np.linalg.norm(ways, axis=1).max() <= MARGIN + 0.5 * self._deepest
        astray, self._astray = self._astray, False
        if shallow and not astray and self._pushes < PUSHES and self._deflation.thin(meeting):
            self._push = self._push + self._deflation.pushed(meeting, ways)
            self._pushes += 1
        else:
            self._deflation.step(meeting)
            self._pushes = 0


def _kept_out(points: Array, bone: Distance, margin: float) -> Array:
    """Points (n, 3) moved out of a bone, to a margin in mm where there is room for it.

    Outside of the bone they go in short steps: across a hollow a long one would lead into the wall beyond.
    """
    x, near = points.copy(), np.arange(len(points))
    for _ in range(STEPS):
        gaps, _, _, normals = bone.signed(x[near])
        short = gaps < margin - 1e-9
        near, gaps, normals = near[short], gaps[short], normals[short]
        if not len(near):
            break
        steps = np.minimum(margin - gaps, np.maximum(-gaps, 0.0) + SHORT)
        x[near] += steps[:, None] * normals
    return x
