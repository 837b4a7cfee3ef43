"""The server of the page of curves: gives surfaces, takes edits, writes the file and its tets."""

from __future__ import annotations

import json
import secrets
from importlib.resources import files

from handpipe.cli.local_server import HTML, JSON, POLICY, SCRIPT, STYLE, LocalHandler, LocalServer
from handpipe.cli.muscle_curves.bone_session import BoneSession
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
        super().__init__(_CurveHandler, "curves")
        self.session = session

    def server_close(self) -> None:
        """Close the server, and end a solve that runs."""
        super().server_close()
        self.session.back_to_rest()


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


class BoneServer(LocalServer):
    """Serves the page on which bones are placed at `address`, which holds a secret.

    Parameters
    ----------
    session : BoneSession
        What is edited.
    """

    def __init__(self, session: BoneSession) -> None:
        super().__init__(_BoneHandler, "bones")
        self.session = session


def serve_bones(session: BoneSession, browser: bool) -> None:
    """Serve the page of bones until the person ends it, by its button or by Ctrl-C.

    Parameters
    ----------
    session : BoneSession
        What is edited.
    browser : bool
        Whether to open it.
    """
    with BoneServer(session) as server:
        server.serve(f"{session.target}: bones inside {session.skin_file}", browser)


class _SessionHandler(LocalHandler):
    """Gives a page, surfaces and the state of a session, takes edits, saves."""

    server: CurveServer | BoneServer
    package = PACKAGE
    page = ""

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
        else:
            return False
        return True

    def take(self, name: str) -> bool:
        session = self.server.session
        if name == "edit":
            self._edit()
        elif name == "save":
            self.work(lambda: self.say(session.save()))
        else:
            return False
        return True

    def _page(self) -> None:
        """The page, which allows the one script that stands inside."""
        nonce = secrets.token_urlsafe(16)
        page = files(PACKAGE).joinpath("static", self.page).read_text(encoding="utf-8")
        page = page.replace("NONCE", nonce).replace("IMPORT_MAP", import_map({}))
        policy = f"{POLICY}; script-src 'self' data: 'nonce-{nonce}'"
        self.answer(page.encode(), HTML, {"Content-Security-Policy": policy})

    def _edit(self) -> None:
        content = self.received(LONGEST)
        if content is not None:
            self.work(lambda: self.answer(self.server.session.edit(content), BYTES))


COMMON = {  # files of both pages
    "editor.js": ("editor.js", SCRIPT),
    "view.js": ("view.js", SCRIPT),
    "page.css": ("page.css", STYLE),
}


class _CurveHandler(_SessionHandler):
    """The page of curves, which makes tets, too."""

    server: CurveServer
    page = "page.html"
    static = {"page.js": ("page.js", SCRIPT), "pose.js": ("pose.js", SCRIPT), **COMMON}

    def give(self, name: str) -> bool:
        session = self.server.session
        if name == "fibres":
            self.work(lambda: self.answer(session.fibres(), BYTES))
        elif name == "joints.json":
            self.work(lambda: self.answer(json.dumps(session.joints()).encode(), JSON))
        elif name == "pose.json":  # while another request works, too
            self.answer(json.dumps(session.pose_state()).encode(), JSON)
        elif name == "posed":
            self.work(lambda: self.answer(session.posed(), BYTES))
        else:
            return super().give(name)
        return True

    def take(self, name: str) -> bool:
        session = self.server.session
        if name == "tets":
            self.work(lambda: self.say(session.make_tets()))
        elif name == "pose":
            content = self.received(LONGEST)
            if content is not None:
                self.work(lambda: self.say(session.start_pose(content)))
        elif name == "rest":
            self.work(lambda: self.say(session.back_to_rest()))
        else:
            return super().take(name)
        return True


class _BoneHandler(_SessionHandler):
    """The page of bones."""

    server: BoneServer
    page = "bones.html"
    static = {"bones.js": ("bones.js", SCRIPT), **COMMON}
