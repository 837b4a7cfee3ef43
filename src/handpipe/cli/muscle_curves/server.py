"""The server of the page of curves: gives surfaces, takes edits, writes the file and its tets."""

from __future__ import annotations

import json
import secrets
import threading
from collections.abc import Callable
from http import HTTPStatus
from importlib.resources import files

from handpipe.cli.muscle_curves.session import CurveSession
from handpipe.cli.page_server import PageHandler, PageServer, serve_page
from handpipe.core import HandpipeError, plain
from handpipe.evaluation.viewer import import_map

LONGEST = 2**22  # bytes of an edit
STATIC = {
    "page.js": "text/javascript; charset=utf-8",
    "editor.js": "text/javascript; charset=utf-8",
    "page.css": "text/css; charset=utf-8",
}
BYTES = "application/octet-stream"


class CurveServer(PageServer):
    """Serves the page of a session at `address`, which holds a secret.

    Parameters
    ----------
    session : CurveSession
        What is edited.
    """

    def __init__(self, session: CurveSession) -> None:
        super().__init__(_Handler)
        self.session = session
        self.working = threading.Lock()


def serve(session: CurveSession, browser: bool) -> None:
    """Serve the page until the person ends it, by its button or by Ctrl-C.

    Parameters
    ----------
    session : CurveSession
        What is edited.
    browser : bool
        Whether to open it.
    """
    serve_page(CurveServer(session), f"{session.target}: muscles as curves", browser)


class _Handler(PageHandler):
    """Gives surfaces, takes edits."""

    server: CurveServer

    def do_GET(self) -> None:
        name, session = self.asked(), self.server.session
        if name is None:
            return
        if name == "":
            self._page()
        elif name in STATIC:
            self.answer(_static(name), STATIC[name])
        elif name == "settings.json":
            self.answer(json.dumps(session.settings()).encode(), "application/json")
        elif name == "surfaces":
            self.answer(session.surfaces(), BYTES)
        elif name == "state":
            self._work(lambda: self.answer(session.state(), BYTES))
        elif name == "fibres":
            self._work(lambda: self.answer(session.fibres(), BYTES))
        else:
            self.refuse_unknown()

    def do_POST(self) -> None:
        name, session = self.asked(), self.server.session
        if name == "edit":
            self._edit()
        elif name == "save":
            self._work(lambda: self.say(session.save()))
        elif name == "tets":
            self._work(lambda: self.say(session.make_tets()))
        elif name == "stop":
            self.stop()
        elif name is not None:
            self.refuse_unknown()

    def _page(self) -> None:
        """The page, which allows the one script that stands inside."""
        nonce = secrets.token_urlsafe(16)
        self.policy = f"{self.policy}; script-src 'self' data: 'nonce-{nonce}'"
        page = _static("page.html").decode()
        page = page.replace("NONCE", nonce).replace("IMPORT_MAP", import_map({}))
        self.answer(page.encode(), "text/html; charset=utf-8")

    def _edit(self) -> None:
        given = self.headers.get("Content-Length", "")
        if not given.isdecimal() or len(given) > 9 or int(given) > LONGEST:
            self.refuse(HTTPStatus.BAD_REQUEST, f"an edit has at most {LONGEST} bytes")
            return
        content = self.rfile.read(int(given))
        self._work(lambda: self.answer(self.server.session.edit(content), BYTES))

    def _work(self, act: Callable[[], None]) -> None:
        """One request at a time; what is wrong is said."""
        try:
            with self.server.working:
                act()
        except HandpipeError as error:
            self.refuse(HTTPStatus.BAD_REQUEST, plain(error))
        except ConnectionError:
            raise
        except Exception as error:
            self.refuse(HTTPStatus.INTERNAL_SERVER_ERROR, plain(error))


def _static(name: str) -> bytes:
    return files("handpipe.cli.muscle_curves").joinpath("static", name).read_bytes()
