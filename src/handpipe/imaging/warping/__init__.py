"""An image of a body at rest carried along with its motion: where each voxel was, and what it then shows."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.imaging.warping.backward_field import BackwardField, Source
    from handpipe.imaging.warping.places import Places
    from handpipe.imaging.warping.similarity import correlation, local_correlation
else:
    __getattr__ = face(__name__)

__all__ = ["BackwardField", "Places", "Source", "correlation", "local_correlation"]
