"""The server of the page of curves: gives surfaces, takes edits, writes the file and its tets."""

from __future__ import annotations

import json
import secrets
from importlib.resources import files

from handpipe.cli.local_server import HTML, JSON, POLICY, SCRIPT, STYLE, LocalHandler, LocalServer
from handpipe.cli.muscle_curves.session import CurveSession
from handpipe.evaluation.viewer import import_map

LONGEST = 2**22  # bytes of an edit
PACKAGE = "handpipe.cli.muscle_curves"
BYTES = "application/octet-stream"


class CurveServer(LocalServer):
    """Serves the page of a session at `address`, which holds a secret.

    Parameters
    ----------
    session : CurveSession
        What is edited.
    """

    def __init__(self, session: CurveSession) -> None:
        super().__init__(_Handler, "curves")
        self.session = session


def serve(session: CurveSession, browser: bool) -> None:
    """Serve the page until the person ends it, by its button or by Ctrl-C.

    Parameters
    ----------
    session : CurveSession
        What is edited.
    browser : bool
        Whether to open it.
    """
    with CurveServer(session) as server:
        server.serve(f"{session.target}: muscles as curves", browser)


class _Handler(LocalHandler):
    """Gives surfaces, takes edits."""

    server: CurveServer
    package = PACKAGE
    static = {
        "page.js": ("page.js", SCRIPT),
        "editor.js": ("editor.js", SCRIPT),
        "page.css": ("page.css", STYLE),
    }

    def give(self, name: str) -> bool:
        session = self.server.session
        if name == "":
            self._page()
        elif name == "settings.json":
            self.answer(json.dumps(session.settings()).encode(), JSON)
        elif name == "surfaces":
            self.answer(session.surfaces(), BYTES)
        elif name == "state":
            self.work(lambda: self.answer(session.state(), BYTES))
        elif name == "fibres":
            self.work(lambda: self.answer(session.fibres(), BYTES))
        else:
            return False
        return True

    def take(self, name: str) -> bool:
        session = self.server.session
        if name == "edit":
            self._edit()
        elif name == "save":
            self.work(lambda: self.say(session.save()))
        elif name == "tets":
            self.work(lambda: self.say(session.make_tets()))
        else:
            return False
        return True

    def _page(self) -> None:
        """The page, which allows the one script that stands inside."""
        nonce = secrets.token_urlsafe(16)
        page = files(PACKAGE).joinpath("static", "page.html").read_text(encoding="utf-8")
        page = page.replace("NONCE", nonce).replace("IMPORT_MAP", import_map({}))
        policy = f"{POLICY}; script-src 'self' data: 'nonce-{nonce}'"
        self.answer(page.encode(), HTML, {"Content-Security-Policy": policy})

    def _edit(self) -> None:
        content = self.received(LONGEST)
        if content is not None:
            self.work(lambda: self.answer(self.server.session.edit(content), BYTES))
