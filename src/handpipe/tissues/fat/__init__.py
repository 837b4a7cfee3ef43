"""Fat and skin: one mesh around all other tissues, its strains over poses, its layers; the flesh."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.tissues.fat.constraints import cut_ends, inner_points
    from handpipe.tissues.fat.creases.layer import CreaseLayer, load_skin
    from handpipe.tissues.fat.layer import FatStrains, TissueLayer, load_fat
    from handpipe.tissues.fat.mesh import inner_surface, skin_share, tissue_mesh, without_pockets
    from handpipe.tissues.fat.nails import as_vector, fit_correction, nail_vertices, on_skin
    from handpipe.tissues.fat.other_equilibria import Restart, restarts
    from handpipe.tissues.fat.skin import Rigid, Skin, closed_skin
    from handpipe.tissues.fat.strains import FitSettings, fit_strains
    from handpipe.tissues.fat.tissue import Tissue, TissueSettings
else:
    __getattr__ = face(__name__)

__all__ = [
    "CreaseLayer",
    "FatStrains",
    "FitSettings",
    "Restart",
    "Rigid",
    "Skin",
    "Tissue",
    "TissueLayer",
    "TissueSettings",
    "as_vector",
    "closed_skin",
    "cut_ends",
    "fit_correction",
    "fit_strains",
    "inner_points",
    "inner_surface",
    "load_fat",
    "load_skin",
    "nail_vertices",
    "on_skin",
    "restarts",
    "skin_share",
    "tissue_mesh",
    "without_pockets",
]
