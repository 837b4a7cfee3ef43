"""Muscles as curves, and bones inside a skin, on pages in the browser: sessions, servers, an example."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.cli.muscle_curves.bone_session import BoneSession, open_bones
    from handpipe.cli.muscle_curves.example import write_example
    from handpipe.cli.muscle_curves.server import BoneServer, CurveServer, serve, serve_bones
    from handpipe.cli.muscle_curves.session import CurveSession, curves_command, open_session
else:
    __getattr__ = face(__name__)

__all__ = [
    "BoneServer",
    "BoneSession",
    "CurveServer",
    "CurveSession",
    "curves_command",
    "open_bones",
    "open_session",
    "serve",
    "serve_bones",
    "write_example",
]
