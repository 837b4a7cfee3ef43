"""Levels below the simulation: learned from a scene's frames, and scenes that show them."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.levels import animate, learn_levels
else:
    __getattr__ = face(__name__)

__all__ = ["animate", "learn_levels"]
