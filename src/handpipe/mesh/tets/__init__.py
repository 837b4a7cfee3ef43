"""A tetrahedral mesh: its measures, operators, files, and the points that it carries."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.mesh.tets.embedding import Embedding, Locator, nearest_tets
    from handpipe.mesh.tets.operators import (
        cotangent_laplacian,
        dirichlet_matrix,
        gradient_operator,
        mass_lumped,
        shape_gradients,
        tet_laplacian,
        tet_neighbours,
        tet_pieces,
    )
    from handpipe.mesh.tets.tet_files import read_tets
    from handpipe.mesh.tets.tetrahedra import EDGES, FACES, TetMesh
else:
    __getattr__ = face(__name__)

__all__ = [
    "EDGES",
    "Embedding",
    "FACES",
    "Locator",
    "TetMesh",
    "cotangent_laplacian",
    "dirichlet_matrix",
    "gradient_operator",
    "mass_lumped",
    "nearest_tets",
    "read_tets",
    "shape_gradients",
    "tet_laplacian",
    "tet_neighbours",
    "tet_pieces",
]
