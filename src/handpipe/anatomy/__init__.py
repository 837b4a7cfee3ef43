"""Templates of hands: made from curves or surfaces, improved for simulation, and fitted to a person."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.anatomy import improvement, person, shipped, templates
else:
    __getattr__ = face(__name__)

__all__ = ["improvement", "person", "shipped", "templates"]
