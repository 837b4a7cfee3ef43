"""The page on which a person marks points in a picture, and its server, which makes the hand."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from handpipe.anatomy.shipped import ShippedHand
from handpipe.cli.local_server import HTML, JSON, SCRIPT, STYLE, LocalHandler, LocalServer
from handpipe.cli.person.making import Asked, make
from handpipe.cli.person.picture import Picture
from handpipe.cli.person.played_hand import PlayedHand
from handpipe.cli.person.where import drawing
from handpipe.core import InputError, read_text, write_text

POINTS = "points.json"
LARGEST = 2**20  # bytes of marked points
# The page of the hand has its scripts in itself.
OF_HAND = (
    "default-src 'none'; script-src 'unsafe-inline' data: blob:; style-src 'unsafe-inline'; img-src data:"
)


class PointsServer(LocalServer):
    """Serves the page of a picture at `address`, which holds a secret.

    Parameters
    ----------
    picture : Path
        JPEG, PNG or WebP.
    asked : Asked
        What is made of the points; `points` is the file that the page writes.

    Raises
    ------
    InputError
        For a picture that cannot be read, and a file of earlier points that is no JSON.
    """

    def __init__(self, picture: Path, asked: Asked) -> None:
        self.picture = Picture.read(picture)
        self.asked = asked
        self.made: Path | None = None  # the page of the hand
        shipped = ShippedHand.load()
        self.settings = {
            "title": picture.name,
            "file": str(asked.points),
            "hand": asked.hand or "right",
            "view": asked.view or "back",
            "drawing": drawing(PlayedHand.of(shipped, shipped.template)),
            "marked": _earlier(asked.points),
        }
        super().__init__(_Handler, "photograph")


def mark(picture: Path, asked: Asked, browser: bool) -> None:
    """Serve the page until the person ends it, by its button or by Ctrl-C.

    Parameters
    ----------
    picture : Path
        JPEG, PNG or WebP.
    asked : Asked
        What is made of the points; `points` is the file that the page writes.
    browser : bool
        Whether to open it.
    """
    with PointsServer(picture, asked) as server:
        server.serve(f"Mark the points of {picture}", browser)


def _earlier(path: Path) -> dict[str, Any] | None:
    """Points that an earlier page wrote, if there are any."""
    if not path.is_file():
        return None
    try:
        found = json.loads(read_text(path))
    except ValueError as error:
        raise InputError(path, "JSON", str(error), "Mend or delete the file") from error
    if not isinstance(found, dict):
        raise InputError(path, "JSON", "holds no points of a picture", "Delete the file")
    return found


class _Handler(LocalHandler):
    server: PointsServer
    package = "handpipe.cli.person"
    static = {"": ("page.html", HTML), "page.js": ("page.js", SCRIPT), "page.css": ("page.css", STYLE)}

    def give(self, name: str) -> bool:
        server = self.server
        if name == "settings.json":
            self.answer(json.dumps(server.settings).encode(), JSON)
        elif name == "picture":
            self.answer(server.picture.path.read_bytes(), server.picture.kind)
        elif name == "hand" and server.made is not None:
            self.answer(server.made.read_bytes(), HTML, {"Content-Security-Policy": OF_HAND})
        else:
            return False
        return True

    def take(self, name: str) -> bool:
        if name not in ("save", "make"):
            return False
        sent = self.received(LARGEST)
        if sent is not None:
            answer = self._saved if name == "save" else self._made
            self.work(lambda: self.say(answer(sent)))
        return True

    def _saved(self, sent: bytes) -> str:
        """Write what is marked, complete or not."""
        path, marked = self.server.asked.points, json.loads(sent)
        write_text(path, json.dumps({"picture": self.server.picture.path.name, **marked}, indent=1) + "\n")
        self.server.settings["marked"] = marked
        return f"saved {len(marked['points'])} points to {path}"

    def _made(self, sent: bytes) -> str:
        """Write what is marked, and make the hand."""
        self._saved(sent)
        made = make(replace(self.server.asked, hand=None, view=None))
        self.server.made = made.files[0]
        return "\n".join([f"The hand is in {made.files[0].parent}.", *made.said])
