"""The server of the page: on this machine alone, for who has the address, until it is ended.

It gives the files of the page, the volume and the drawing, and writes one file, that of the strokes.
"""

from __future__ import annotations

import json
import logging
import secrets
import threading
import webbrowser
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files

from handpipe.cli.drawing.canvas import Canvas
from handpipe.core import HandpipeError, plain

log = logging.getLogger(__name__)

HERE = "127.0.0.1"
PATIENCE = 60.0  # s without a byte after which a connection ends
PAUSE = 0.2  # s without a byte after which a refused request has been sent
UNREAD = 2**26  # bytes of a refused request that are read, at most
VIEWER = "niivue-0.69.0.umd.js.gz"
STATIC = {
    "": ("page.html", "text/html; charset=utf-8"),
    "page.js": ("page.js", "text/javascript; charset=utf-8"),
    "page.css": ("page.css", "text/css; charset=utf-8"),
    "viewer.js": (VIEWER, "text/javascript; charset=utf-8"),
    "licence.txt": ("NIIVUE-LICENSE.txt", "text/plain; charset=utf-8"),
}
# Nothing from the network, and no page of another site around this one.
POLICY = (
    "default-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; "
    "frame-ancestors 'none'; form-action 'none'; base-uri 'none'"
)


class DrawingServer(ThreadingHTTPServer):
    """Serves the page of a canvas at `address`, which holds a secret.

    Parameters
    ----------
    canvas : Canvas
        What is drawn on.
    """

    daemon_threads = True

    def __init__(self, canvas: Canvas) -> None:
        super().__init__((HERE, 0), _Handler)
        self.canvas = canvas
        self.secret = secrets.token_urlsafe(24)
        self.saving = threading.Lock()

    @property
    def hosts(self) -> tuple[str, str]:
        """Hosts of requests that are answered: a page of a foreign name that leads here is none."""
        return f"{HERE}:{self.server_port}", f"localhost:{self.server_port}"

    @property
    def address(self) -> str:
        """URL of the page."""
        return f"http://{HERE}:{self.server_port}/{self.secret}/"


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
        print(f"{canvas.title}\n{server.address}\nEnd it by its button or by Ctrl-C", flush=True)
        if browser:
            webbrowser.open(server.address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            print()


class _Handler(BaseHTTPRequestHandler):
    """Answers requests that know the secret."""

    server: DrawingServer
    timeout = PATIENCE

    def do_GET(self) -> None:
        name, canvas = self._asked(), self.server.canvas
        if name is None:
            return
        if name in STATIC:
            file, kind = STATIC[name]
            content = files("handpipe.cli.drawing").joinpath("static", file).read_bytes()
            self._answer(content, kind, {"Content-Encoding": "gzip"} if file.endswith(".gz") else {})
        elif name == "settings.json":
            settings = {
                "title": canvas.title,
                "pens": canvas.pens,
                "colours": canvas.colours,
                "shape": canvas.volume.shape,
                "file": None if canvas.target is None else str(canvas.target),
            }
            self._answer(json.dumps(settings).encode(), "application/json")
        elif name == "volume.nii":
            self._answer(canvas.image(), "application/octet-stream")
        elif name == "drawing":
            self._answer(canvas.drawn(), "application/octet-stream")
        else:
            self._refuse(HTTPStatus.NOT_FOUND, "There is no such page")

    def do_POST(self) -> None:
        name = self._asked()
        if name == "save":
            self._save()
        elif name == "stop":
            self._say("ended")
            threading.Thread(target=self.server.shutdown).start()
        elif name is not None:
            self._refuse(HTTPStatus.NOT_FOUND, "There is no such page")

    def _save(self) -> None:
        canvas, expected = self.server.canvas, self.server.canvas.drawing.size
        given = self.headers.get("Content-Length", "")
        if given != str(expected):
            problem = f"the drawing has {given or 'no'} bytes; the volume has {expected} voxels"
            self._refuse(HTTPStatus.BAD_REQUEST, problem)
            return
        drawn = self.rfile.read(expected)
        try:
            with self.server.saving:
                count = canvas.save(drawn)
        except HandpipeError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, plain(error))
        except OSError as error:
            self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, plain(error))
        else:
            kept = f"; the earlier file is {canvas.kept.name}" if canvas.kept else ""
            self._say(f"saved {count} voxels to {canvas.target}{kept}")

    def _asked(self) -> str | None:
        """What is asked for, behind the secret; None after a refusal."""
        _, given, *rest = [*self.path.split("/", 2), ""]
        known = secrets.compare_digest(given.encode(), self.server.secret.encode())
        if known and self.headers.get("Host") in self.server.hosts:
            return rest[0]
        self._refuse(HTTPStatus.FORBIDDEN, "Open the address that handpipe draw printed")
        return None

    def _say(self, text: str) -> None:
        self._answer(json.dumps({"said": text}).encode(), "application/json")

    def _refuse(self, status: HTTPStatus, text: str) -> None:
        if self.command == "POST":
            self._drain()
        self._answer(json.dumps({"said": text}).encode(), "application/json", status=status)

    def _drain(self) -> None:
        """Read what was sent, within limits: a connection with unread bytes is reset, and the answer lost."""
        self.connection.settimeout(PAUSE)
        left = UNREAD
        with suppress(OSError):
            while left > 0 and (read := self.rfile.read1(min(left, 2**16))):
                left -= len(read)

    def _answer(
        self,
        content: bytes,
        kind: str,
        headers: dict[str, str] | None = None,
        status: HTTPStatus = HTTPStatus.OK,
    ) -> None:
        self.send_response(status)
        common = {
            "Content-Type": kind,
            "Content-Length": str(len(content)),
            "Cache-Control": "no-store",
            "Content-Security-Policy": POLICY,
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
        }
        for key, value in {**common, **(headers or {})}.items():
            self.send_header(key, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: object) -> None:
        log.debug(format, *args)
