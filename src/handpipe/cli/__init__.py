"""The command `handpipe`: a subject from its scans to its animated hand, over the workflow."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.cli.commands import main
else:
    __getattr__ = face(__name__)

__all__ = ["main"]
