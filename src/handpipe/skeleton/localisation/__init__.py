"""Where each bone is in a pose's image before it is segmented, and how sure that is."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.skeleton.localisation.bright_solids import BrightSolid, SolidShape, find_solids
    from handpipe.skeleton.localisation.locating import HandModel, locate, moved_surfaces
    from handpipe.skeleton.localisation.location_confidence import confidences, read_located, write_located
    from handpipe.skeleton.localisation.named_solids import Named, TemplateHand, name_solids
    from handpipe.skeleton.localisation.second_search import search_again
else:
    __getattr__ = face(__name__)

__all__ = [
    "BrightSolid",
    "HandModel",
    "Named",
    "SolidShape",
    "TemplateHand",
    "confidences",
    "find_solids",
    "locate",
    "moved_surfaces",
    "name_solids",
    "read_located",
    "search_again",
    "write_located",
]
