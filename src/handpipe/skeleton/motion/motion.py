"""A motion as the angles of its frames, with what was found while they were made."""

from __future__ import annotations

from dataclasses import dataclass, field

from handpipe.core import Metrics
from handpipe.skeleton.joints.angles import Angles

UNITS = {"target_distance": "mm", "tracking_residual": "mm", "bridged": "1"}


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

    @property
    def metrics(self) -> Metrics:
        """The number of frames, and the largest of each figure over them."""
        found: Metrics = {"frames": (float(len(self.frames)), "frames")}
        for name, unit in UNITS.items():
            values = [figures[name] for figures in self.figures.values() if name in figures]
            if values and name == "bridged":
                found["frames_bridged"] = (sum(values), "frames")
            elif values:
                found[f"{name}_max"] = (max(values), unit)
                found[f"{name}_mean"] = (sum(values) / len(values), unit)
        return found
