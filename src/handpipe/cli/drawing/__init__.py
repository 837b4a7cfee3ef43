"""A page in the browser to look at a pose and to draw its strokes: what is drawn on, and its server."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.cli.drawing.canvas import Canvas, labels_to_look_at, strokes_to_draw
    from handpipe.cli.drawing.server import DrawingServer, serve
else:
    __getattr__ = face(__name__)

__all__ = ["Canvas", "DrawingServer", "labels_to_look_at", "serve", "strokes_to_draw"]
