"""What people look at: the neutral image in motion, its likeness to scans, movies, a rigged hand."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.views import (
        evaluate_images,
        export_mechanics,
        export_rigged,
        export_scan,
        export_skeleton,
        find_equilibria,
        move_image,
        move_images,
        render_movie,
        render_volumes,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "evaluate_images",
    "export_mechanics",
    "export_skeleton",
    "export_rigged",
    "export_scan",
    "find_equilibria",
    "move_image",
    "move_images",
    "render_movie",
    "render_volumes",
]
