"""Pictures and movies of surfaces and volumes by VTK, off screen."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.evaluation.rendering.bodies import Drawable
    from handpipe.evaluation.rendering.camera import Camera, Cut
    from handpipe.evaluation.rendering.movies import write_movie
    from handpipe.evaluation.rendering.pictures import COLOUR_MAP, ColourBar, render
    from handpipe.evaluation.rendering.volumes import TRANSFERS, Transfer, render_volume, volume_extent
    from handpipe.evaluation.rendering.window import Image
else:
    __getattr__ = face(__name__)

__all__ = [
    "COLOUR_MAP",
    "TRANSFERS",
    "Camera",
    "ColourBar",
    "Cut",
    "Drawable",
    "Image",
    "Transfer",
    "render",
    "render_volume",
    "volume_extent",
    "write_movie",
]
