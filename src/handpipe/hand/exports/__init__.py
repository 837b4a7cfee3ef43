"""Files of a simulated hand for other programs: exact frames, and a rig with corrective shapes."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.hand.exports.bone_files import write_bones
    from handpipe.hand.exports.export import (
        surface_triangles,
        write_glb,
        write_numbers,
        write_obj_sequence,
        write_vtu_series,
    )
    from handpipe.hand.exports.input_deck import write_deck
    from handpipe.hand.exports.linear_blend import BONES_A_VERTEX, LinearBlend
    from handpipe.hand.exports.mechanics import Mechanical, muscle_fibres, tet_fields, with_mechanics
    from handpipe.hand.exports.mjcf import residual_motion, write_mjcf
    from handpipe.hand.exports.osim import write_osim
    from handpipe.hand.exports.rigged_glb import write_rigged_glb
    from handpipe.hand.exports.scan_glb import placed_parts, write_scan_glb
    from handpipe.hand.exports.textured_scan import read_textured
    from handpipe.hand.exports.usd_cache import write_usd
else:
    __getattr__ = face(__name__)

__all__ = [
    "BONES_A_VERTEX",
    "LinearBlend",
    "Mechanical",
    "muscle_fibres",
    "placed_parts",
    "read_textured",
    "residual_motion",
    "surface_triangles",
    "tet_fields",
    "with_mechanics",
    "write_bones",
    "write_deck",
    "write_glb",
    "write_mjcf",
    "write_numbers",
    "write_obj_sequence",
    "write_osim",
    "write_rigged_glb",
    "write_scan_glb",
    "write_usd",
    "write_vtu_series",
]
