"""Files of surfaces, read and written: OBJ, PLY and STL; scans; the materials and images that files name."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.mesh.files.scan import read_scan
    from handpipe.mesh.files.surface_files import (
        METRES,
        MICROMETRES,
        SURFACE_SUFFIXES,
        read_surface,
        write_surface,
    )
    from handpipe.mesh.files.textures import ALL, images_of_materials, texture_files
else:
    __getattr__ = face(__name__)

__all__ = [
    "ALL",
    "METRES",
    "MICROMETRES",
    "SURFACE_SUFFIXES",
    "images_of_materials",
    "read_scan",
    "read_surface",
    "texture_files",
    "write_surface",
]
