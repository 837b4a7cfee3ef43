"""A tissue bent in small steps from one pose to another, its skin behind a barrier all the way."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.tissues.fat.bending.bones import partway
    from handpipe.tissues.fat.bending.path import Origin, Pace, bent
else:
    __getattr__ = face(__name__)

__all__ = ["Origin", "Pace", "bent", "partway"]
