"""The 3D view of a report: surfaces in every frame, and the page's script, which three.js draws with."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.evaluation.viewer.inlined import import_map, page_scripts
    from handpipe.evaluation.viewer.scene_data import view_data
else:
    __getattr__ = face(__name__)

__all__ = ["import_map", "page_scripts", "view_data"]
