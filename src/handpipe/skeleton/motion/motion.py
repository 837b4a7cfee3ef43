"""A motion as the angles of its frames, with what was found while they were made."""

from __future__ import annotations

from dataclasses import dataclass, field

from handpipe.skeleton.joints.angles import Angles


@dataclass(frozen=True)
class Motion:
    """Frames of a motion.

    Parameters
    ----------
    frames : dict of str to dict of str to float
        Angles in rad within their limits, by frame and angle name.
    figures : dict of str to dict of str to float
        Figures of frames in mm or without unit, by frame: `target_distance`, `tracking_residual`, `bridged`.
    said : list of str
        Sentences on what was not reached, left out or bridged.
    """

    frames: dict[str, Angles]
    figures: dict[str, dict[str, float]] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)
