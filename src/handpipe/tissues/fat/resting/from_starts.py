"""The equilibrium of a tissue from a start, or the first good one of several; its contact is by planes."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

from handpipe.core import Array, ConvergenceError
from handpipe.fem.minimisation import Equilibrium
from handpipe.fem.potentials import Potential
from handpipe.fem.solver import Limits, NearEnough, Settled, equilibrium, settle
from handpipe.tissues.fat.resting.load_case import CONTACTS, OPTIONS, LoadCase

log = logging.getLogger(__name__)

CROWDED = 0.5  # mm of the skin's self-penetration, at the start or the end, from which tissue is shrunk
LOST = 3.0  # mm of a further start's self-penetration, from which it leads where the first one led
SIZES = (0.75, 0.9)  # relative sizes of the shrunk tissue, in turn; at 0.6 thin places are crushed
SOFTEST = 1e-3  # of the constraints' stiffness, where they stiffen in steps


def settled_from(case: LoadCase, start: Array, contacts: Limits = CONTACTS) -> Settled:
    """The equilibrium near a start; contact planes are renewed until the skin has settled.

    Parameters
    ----------
    case : LoadCase
        The tissue in a frame.
    start : array (n, 3)
        Vertices in mm from which it starts.
    contacts : Limits
        Renewals of contact planes, and what counts as settled.

    Returns
    -------
    Settled
        The equilibrium.

    Raises
    ------
    ConvergenceError
        Where there is no equilibrium, or the skin does not come to rest.
    """
    return settle(partial(_near, case), start, contacts, "soft tissue", case.skin_motion)


def at_rest(case: LoadCase, starts: Sequence[Array]) -> Settled:
    """The equilibrium from the first start that ends without self-penetration.

    Self-penetration is that of the skin. Starts are tried in turn, by way of smaller sizes where their
    skin lies in itself. A start whose skin did not is tried again by way of smaller sizes if the
    equilibrium's skin does. Where every equilibrium has self-penetration, the one with the least is
    taken. Once there is an equilibrium, starts with skin 3 mm or more in itself are not tried: their
    bodies leave no room, and that is the pose's fault.

    Parameters
    ----------
    case : LoadCase
        The tissue in a frame.
    starts : sequence of array (n, 3)
        Vertices in mm, best first.

    Returns
    -------
    Settled
        The equilibrium.

    Raises
    ------
    ConvergenceError
        The last one, where no start led to an equilibrium.
    """
    overlap = case.tissue.overlap
    found: list[Settled] = []
    failure: ConvergenceError | None = None
    for way in _ways(case, _worth_trying(case, starts, found)):
        if found:
            text = "soft tissue: skin self-penetration %.2f mm; retrying from the next start"
            log.info(text, overlap(found[-1].x))
        try:
            found.append(settled_from(case, way))
        except ConvergenceError as error:
            log.warning("soft tissue: %s", error)
            failure = error
        else:
            if overlap(found[-1].x) < CROWDED:
                return found[-1]
    if not found and failure is not None:
        raise failure
    return min(found, key=lambda settled: overlap(settled.x))


def opened(case: LoadCase, x: Array, anyway: bool = False) -> Array:
    """A start with open creases.

    The tissue is shrunk, draws back from the creases, and grows again. Skin deep in other skin needs this
    room to come out. A size without an equilibrium is skipped.

    Parameters
    ----------
    case : LoadCase
        The tissue in a frame.
    x : array (n, 3)
        Vertices in mm.
    anyway : bool
        Whether to shrink it where its skin hardly penetrates itself, too; else the result is x itself there.

    Returns
    -------
    array (n, 3)
        The start in mm.
    """
    overlap = case.tissue.overlap
    if not anyway and overlap(x) < CROWDED:
        return x
    for size in SIZES:
        try:
            x = _near(case.with_strains(size * case.elastic.strains), x).x
        except ConvergenceError as error:
            log.warning("soft tissue: no equilibrium at %.2f of its size: %s", size, error)
        else:
            log.info("soft tissue: at %.2f of its size, skin self-penetration %.2f mm", size, overlap(x))
    return x


def _worth_trying(case: LoadCase, starts: Iterable[Array], found: Sequence[Settled]) -> Iterator[Array]:
    """Starts (n, 3), without those deep in themselves once something is found."""
    for start in starts:
        if found and (depth := case.tissue.overlap(start)) >= LOST:
            log.info("soft tissue: a start with skin %.2f mm in itself is not tried", depth)
            continue
        yield start


def _ways(case: LoadCase, starts: Iterable[Array]) -> Iterator[Array]:
    """Initial guesses (n, 3): each start, opened if it has to be, then opened anyway."""
    for start in starts:
        way = opened(case, start)
        yield way
        if way is start:
            yield opened(case, start, anyway=True)


def _near(case: LoadCase, start: Array, enough: NearEnough | None = None) -> Equilibrium:
    """The equilibrium near a start (n, 3), with contact planes as there."""
    options = replace(OPTIONS, enough=enough)
    try:
        given = case.potentials(start)
        return equilibrium.solve(given, start, options=options, analyses=case.tissue.analyses)
    except ConvergenceError as error:
        log.info("%s; retrying with constraints that stiffen in steps", error)

    def softened(t: float) -> list[Potential]:
        return case.potentials(start, SOFTEST ** (1 - t))

    return equilibrium.continuation(softened, start, options=OPTIONS)
