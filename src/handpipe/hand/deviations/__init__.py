"""Error bars: how far the points of a simulated hand are expected to be off, from what was fitted alone."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.hand.deviations.body import BodyDeviation
    from handpipe.hand.deviations.bones import JointDeviation, scanned_covariances
    from handpipe.hand.deviations.organs import (
        ExampleTissue,
        Seen,
        centreline,
        of_muscle,
        of_skin,
        of_tendon,
    )
    from handpipe.hand.deviations.stated import CALIBRATIONS, HandDeviations
    from handpipe.hand.deviations.stated_frames import with_deviations, write_stated
else:
    __getattr__ = face(__name__)

__all__ = [
    "BodyDeviation",
    "CALIBRATIONS",
    "ExampleTissue",
    "HandDeviations",
    "JointDeviation",
    "Seen",
    "centreline",
    "of_muscle",
    "of_skin",
    "of_tendon",
    "scanned_covariances",
    "with_deviations",
    "write_stated",
]
