"""The server of the page: it gives the volume and the drawing, and writes one file, that of the strokes."""

from __future__ import annotations

import json
from http import HTTPStatus

from handpipe.cli.drawing.canvas import Canvas
from handpipe.cli.local_server import HTML, JSON, PLAIN, SCRIPT, STYLE, LocalHandler, LocalServer

VIEWER = "niivue-0.69.0.umd.js.gz"
BYTES = "application/octet-stream"


class DrawingServer(LocalServer):
    """Serves the page of a canvas at `address`, which holds a secret.

    Parameters
    ----------
    canvas : Canvas
        What is drawn on.
    """

    def __init__(self, canvas: Canvas) -> None:
        super().__init__(_Handler, "draw")
        self.canvas = canvas


def serve(canvas: Canvas, browser: bool) -> None:
    """Serve the page until the person ends it, by its button or by Ctrl-C.

    Parameters
    ----------
    canvas : Canvas
        What is drawn on.
    browser : bool
        Whether to open it.
    """
    with DrawingServer(canvas) as server:
        server.serve(canvas.title, browser)


class _Handler(LocalHandler):
    server: DrawingServer
    package = "handpipe.cli.drawing"
    static = {
        "": ("page.html", HTML),
        "page.js": ("page.js", SCRIPT),
        "page.css": ("page.css", STYLE),
        "viewer.js": (VIEWER, SCRIPT),
        "licence.txt": ("NIIVUE-LICENSE.txt", PLAIN),
    }

    def give(self, name: str) -> bool:
        canvas = self.server.canvas
        if name == "settings.json":
            settings = {
                "title": canvas.title,
                "pens": canvas.pens,
                "colours": canvas.colours,
                "shape": canvas.volume.shape,
                "file": None if canvas.target is None else str(canvas.target),
            }
            self.answer(json.dumps(settings).encode(), JSON)
        elif name == "volume.nii":
            self.answer(canvas.image(), BYTES)
        elif name == "drawing":
            self.answer(canvas.drawn(), BYTES)
        else:
            return False
        return True

    def take(self, name: str) -> bool:
        if name == "save":
            self._save()
        return name == "save"

    def _save(self) -> None:
        expected = self.server.canvas.drawing.size
        given = self.headers.get("Content-Length", "")
        if given != str(expected):
            problem = f"the drawing has {given or 'no'} bytes; the volume has {expected} voxels"
            self.refuse(HTTPStatus.BAD_REQUEST, problem)
            return
        drawn = self.rfile.read(expected)
        self.work(lambda: self.say(self._saved(drawn)))

    def _saved(self, drawn: bytes) -> str:
        """Write the drawing."""
        canvas = self.server.canvas
        count = canvas.save(drawn)
        kept = f"; the earlier file is {canvas.kept.name}" if canvas.kept else ""
        return f"saved {count} voxels to {canvas.target}{kept}"
