"""Levels below the simulation: learned from a scene's frames, shown by scenes, and played on a page."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.levels import animate, export_player, learn_levels
else:
    __getattr__ = face(__name__)

__all__ = ["animate", "export_player", "learn_levels"]
