"""Levels below the simulation: learned from frames, or of springs; shown by scenes, and played on a page."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.levels import animate, animate_springs, export_player, learn_levels
else:
    __getattr__ = face(__name__)

__all__ = ["animate", "animate_springs", "export_player", "learn_levels"]
