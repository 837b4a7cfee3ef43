"""New meshes: isosurfaces, remeshing, repair, and filling surfaces with tetrahedra."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.mesh.generation import implicit
    from handpipe.mesh.generation.graded_remeshing import remesh_graded
    from handpipe.mesh.generation.handles import genus, without_handles
    from handpipe.mesh.generation.implicit import Grid, isosurface, smooth_minimum, union_surface
    from handpipe.mesh.generation.meshing import tetrahedralise
    from handpipe.mesh.generation.remeshing import remesh
    from handpipe.mesh.generation.simplification import simplified
    from handpipe.mesh.generation.surface_repair import repair
else:
    __getattr__ = face(__name__)

__all__ = [
    "Grid",
    "genus",
    "implicit",
    "isosurface",
    "remesh",
    "remesh_graded",
    "repair",
    "simplified",
    "smooth_minimum",
    "tetrahedralise",
    "union_surface",
    "without_handles",
]
