"""Levels below the simulation: learned from a scene's frames, scenes that show them, and springs."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.levels import animate, animate_springs, learn_levels
else:
    __getattr__ = face(__name__)

__all__ = ["animate", "animate_springs", "learn_levels"]
