"""Frames simulated layer by layer, in one process or two; the digest by which kept frames are reused."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.core import SimulatedFrame
    from handpipe.hand.simulation.ahead import simulated_ahead
    from handpipe.hand.simulation.frame_by_frame import (
        Attempt,
        Failure,
        Simulated,
        attempts,
        simulate,
        simulate_frame,
    )
    from handpipe.hand.simulation.resume import key_of
else:
    __getattr__ = face(__name__)

__all__ = [
    "Attempt",
    "Failure",
    "Simulated",
    "SimulatedFrame",
    "attempts",
    "key_of",
    "simulate",
    "simulate_frame",
    "simulated_ahead",
]
