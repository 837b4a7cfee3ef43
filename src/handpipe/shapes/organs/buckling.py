"""Whether attachments on a line bend an organ that is hinged there: a thin bar gives way sideways.

While the search stretches a bar between two attached ends, its strains may be too long for their distance.
The bar then buckles: its equilibrium is bent although its strains are those of a straight bar, and without
the attachments it would straighten.
"""

from __future__ import annotations

import logging

import numpy as np

from handpipe.core import ConvergenceError, RigidTransform
from handpipe.shapes.observations.attached import Attached
from handpipe.shapes.observations.attachment_targets import AttachmentTargets
from handpipe.shapes.optimisation.search import Search
from handpipe.shapes.optimisation.strain_space import State

log = logging.getLogger(__name__)

BENT = 0.01  # of the organ's size: straight bars have 0.003 at most, those that buckled 0.02 or more


def bend(search: Search, state: State) -> float | None:
    """How far attachments bend an organ, with a warning where it may have buckled.

    Parameters
    ----------
    search : Search
        The search that found the shape.
    state : State
        The shape in equilibrium with its attachments, which are on a line.

    Returns
    -------
    float or None
        Largest distance in mm from the shape that the organ has under the same strains without attachments;
        none where it has no such shape.
    """
    x = state.x
    nothing = AttachmentTargets.place(Attached.nothing(len(x)), (), x)
    try:
        free = search.at(state.unknowns, nothing, x).x
    except ConvergenceError as error:
        log.warning("whether the organ has buckled is not known: without attachments: %s", error)
        return None
    found = float(np.linalg.norm(RigidTransform.fit(free, x)(free) - x, axis=1).max())
    if found > BENT * np.ptp(x, axis=0).max():
        report = "attachments on a line bend the organ by %.3g mm: %s"
        log.warning(report, found, "it may have buckled. Give marks or landmarks of its sides")
    return found
