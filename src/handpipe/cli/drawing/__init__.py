"""Strokes of a pose: proposed from the template hand, and drawn on a page in the browser with its server."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.cli.drawing.canvas import Canvas, labels_to_look_at, strokes_to_draw
    from handpipe.cli.drawing.proposal import propose_strokes
    from handpipe.cli.drawing.server import DrawingServer, serve
else:
    __getattr__ = face(__name__)

__all__ = ["Canvas", "DrawingServer", "labels_to_look_at", "propose_strokes", "serve", "strokes_to_draw"]
