"""Files of surfaces: polygons of OBJ, PLY and STL; the materials and images that they name."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.mesh.files.textures import ALL, images_of_materials, texture_files
else:
    __getattr__ = face(__name__)

__all__ = ["ALL", "images_of_materials", "texture_files"]
