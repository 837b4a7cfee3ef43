"""The server of the page: on this machine alone, for who has the address, until it is ended.

It gives the files of the page, the volume and the drawing, and writes one file, that of the strokes.
"""

from __future__ import annotations

import json
import threading
from http import HTTPStatus
from importlib.resources import files

from handpipe.cli.drawing.canvas import Canvas
from handpipe.cli.page_server import PageHandler, PageServer, serve_page
from handpipe.core import HandpipeError, plain

VIEWER = "niivue-0.69.0.umd.js.gz"
STATIC = {
    "": ("page.html", "text/html; charset=utf-8"),
    "page.js": ("page.js", "text/javascript; charset=utf-8"),
    "page.css": ("page.css", "text/css; charset=utf-8"),
    "viewer.js": (VIEWER, "text/javascript; charset=utf-8"),
    "licence.txt": ("NIIVUE-LICENSE.txt", "text/plain; charset=utf-8"),
}


class DrawingServer(PageServer):
    """Serves the page of a canvas at `address`, which holds a secret.

    Parameters
    ----------
    canvas : Canvas
        What is drawn on.
    """

    def __init__(self, canvas: Canvas) -> None:
        super().__init__(_Handler)
        self.canvas = canvas
        self.saving = threading.Lock()


def serve(canvas: Canvas, browser: bool) -> None:
    """Serve the page until the person ends it, by its button or by Ctrl-C.

    Parameters
    ----------
    canvas : Canvas
        What is drawn on.
    browser : bool
        Whether to open it.
    """
    serve_page(DrawingServer(canvas), canvas.title, browser)


class _Handler(PageHandler):
    """Gives the volume and the drawing, takes the strokes."""

    server: DrawingServer

    def do_GET(self) -> None:
        name, canvas = self.asked(), self.server.canvas
        if name is None:
            return
        if name in STATIC:
            file, kind = STATIC[name]
            content = files("handpipe.cli.drawing").joinpath("static", file).read_bytes()
            self.answer(content, kind, {"Content-Encoding": "gzip"} if file.endswith(".gz") else {})
        elif name == "settings.json":
            settings = {
                "title": canvas.title,
                "pens": canvas.pens,
                "colours": canvas.colours,
                "shape": canvas.volume.shape,
                "file": None if canvas.target is None else str(canvas.target),
            }
            self.answer(json.dumps(settings).encode(), "application/json")
        elif name == "volume.nii":
            self.answer(canvas.image(), "application/octet-stream")
        elif name == "drawing":
            self.answer(canvas.drawn(), "application/octet-stream")
        else:
            self.refuse_unknown()

    def do_POST(self) -> None:
        name = self.asked()
        if name == "save":
            self._save()
        elif name == "stop":
            self.stop()
        elif name is not None:
            self.refuse_unknown()

    def _save(self) -> None:
        canvas, expected = self.server.canvas, self.server.canvas.drawing.size
        given = self.headers.get("Content-Length", "")
        if given != str(expected):
            problem = f"the drawing has {given or 'no'} bytes; the volume has {expected} voxels"
            self.refuse(HTTPStatus.BAD_REQUEST, problem)
            return
        drawn = self.rfile.read(expected)
        try:
            with self.server.saving:
                count = canvas.save(drawn)
        except HandpipeError as error:
            self.refuse(HTTPStatus.BAD_REQUEST, plain(error))
        except OSError as error:
            self.refuse(HTTPStatus.INTERNAL_SERVER_ERROR, plain(error))
        else:
            kept = f"; the earlier file is {canvas.kept.name}" if canvas.kept else ""
            self.say(f"saved {count} voxels to {canvas.target}{kept}")
