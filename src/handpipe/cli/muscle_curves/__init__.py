"""Muscles as curves on a page in the browser: the session of a file, its server, and an example."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.cli.muscle_curves.example import write_example
    from handpipe.cli.muscle_curves.server import CurveServer, serve
    from handpipe.cli.muscle_curves.session import CurveSession, open_session
else:
    __getattr__ = face(__name__)

__all__ = ["CurveServer", "CurveSession", "open_session", "serve", "write_example"]
