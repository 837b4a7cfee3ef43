"""The strains whose static equilibrium meets the marks: the search and its steps (Wang 2021 §5.4)."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.shapes.optimisation.fit import (
        EmbeddedSurface,
        FindMarkers,
        KnownPoints,
        ShapeFit,
        fit_shape,
    )
    from handpipe.shapes.optimisation.settings import MUSCLE, ShapeOptions
else:
    __getattr__ = face(__name__)

__all__ = ["EmbeddedSurface", "FindMarkers", "KnownPoints", "MUSCLE", "ShapeFit", "ShapeOptions", "fit_shape"]
