"""One soft tissue with creases (Wang 2019 §5): where it folds, its graded mesh, its materials."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.tissues.fat.creases.conforming_tets import graded_mesh
    from handpipe.tissues.fat.creases.folding import folding_vertices
    from handpipe.tissues.fat.creases.layer import CreaseLayer
    from handpipe.tissues.fat.creases.materials import Creases, creases_of
else:
    __getattr__ = face(__name__)

__all__ = ["CreaseLayer", "Creases", "creases_of", "folding_vertices", "graded_mesh"]
