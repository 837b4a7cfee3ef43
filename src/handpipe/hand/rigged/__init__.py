"""A simulated hand for riggers: a skeleton, skin weights, and corrective shapes that give every frame."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.hand.rigged.linear_blend import LinearBlend
    from handpipe.hand.rigged.rigged_glb import write_rigged_glb
else:
    __getattr__ = face(__name__)

__all__ = ["LinearBlend", "write_rigged_glb"]
