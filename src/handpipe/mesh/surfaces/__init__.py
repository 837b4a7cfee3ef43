"""A triangle surface: its measures, distances to it, what it carries; lines beside it."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.mesh.surfaces.anchors import Anchors
    from handpipe.mesh.surfaces.barycentric import barycentric_matrix, barycentric_weights
    from handpipe.mesh.surfaces.biharmonic import Biharmonic, left_out
    from handpipe.mesh.surfaces.curves import (
        arclength,
        bishop_frames,
        closest_on_polyline,
        resample,
        tangents,
    )
    from handpipe.mesh.surfaces.distance import (
        EDGE,
        FACE,
        Distance,
        about,
        nearest_feature,
        sample_points,
    )
    from handpipe.mesh.surfaces.hull import convex_hull
    from handpipe.mesh.surfaces.moving import BodyDistances, same_values
    from handpipe.mesh.surfaces.planes import WaysBack, astray, touching_planes
    from handpipe.mesh.surfaces.smoothing import averaging, delta_mush, taubin
    from handpipe.mesh.surfaces.surface import (
        Surface,
        component_labels,
        concatenate,
        directed_edges,
        each_moved,
        place_in_words,
        require_closed,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "EDGE",
    "FACE",
    "Anchors",
    "Biharmonic",
    "BodyDistances",
    "Distance",
    "Surface",
    "WaysBack",
    "about",
    "arclength",
    "astray",
    "averaging",
    "barycentric_matrix",
    "barycentric_weights",
    "bishop_frames",
    "closest_on_polyline",
    "component_labels",
    "concatenate",
    "convex_hull",
    "delta_mush",
    "directed_edges",
    "each_moved",
    "left_out",
    "nearest_feature",
    "place_in_words",
    "require_closed",
    "resample",
    "same_values",
    "sample_points",
    "tangents",
    "taubin",
    "touching_planes",
]
