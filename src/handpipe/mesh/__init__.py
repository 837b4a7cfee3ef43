"""Triangle surfaces and tetrahedral meshes: their measures, distances, files and generation."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.mesh import contact, files, generation, surfaces, tets
else:
    __getattr__ = face(__name__)

__all__ = ["contact", "files", "generation", "surfaces", "tets"]
