"""A page on which a learned hand moves: joint sliders, fingertips to drag, organs to switch."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.evaluation.player.page import write_player
else:
    __getattr__ = face(__name__)

__all__ = ["write_player"]
