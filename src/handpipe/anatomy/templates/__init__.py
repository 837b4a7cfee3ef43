"""Templates from curves or surfaces: tissue functions, fibres, one labelled mesh of all organs."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.anatomy.templates.curves import Curve, MuscleCurves, load_curves, sunken
    from handpipe.anatomy.templates.diffusion import Factorise, superlu
    from handpipe.anatomy.templates.domain import Domain
    from handpipe.anatomy.templates.fibres import harmonic_fibres
    from handpipe.anatomy.templates.hand import (
        HandFile,
        HandTemplate,
        NailCurve,
        build_hand,
        load_hand,
        nail_triangles,
    )
    from handpipe.anatomy.templates.solids import OrganSolid, template_of
    from handpipe.anatomy.templates.tissue_mesh import TissueMesh, build_tissue_mesh
    from handpipe.anatomy.templates.volume_accounts import accounts
else:
    __getattr__ = face(__name__)

__all__ = [
    "Curve",
    "Domain",
    "Factorise",
    "HandFile",
    "HandTemplate",
    "MuscleCurves",
    "NailCurve",
    "OrganSolid",
    "TissueMesh",
    "accounts",
    "build_hand",
    "build_tissue_mesh",
    "harmonic_fibres",
    "load_curves",
    "load_hand",
    "nail_triangles",
    "sunken",
    "superlu",
    "template_of",
]
