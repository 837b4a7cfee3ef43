"""Bones that a person places inside a skin: their file, their surfaces, and what is wrong with them."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.anatomy.placing.bone_file import BoneFile, load_bones, write_bone_file
    from handpipe.anatomy.placing.placed_bones import PlacedBones, bone_faults, place_bones
    from handpipe.anatomy.placing.templates import ROD, Library, read_library
    from handpipe.anatomy.placing.through import middle_inside
else:
    __getattr__ = face(__name__)

__all__ = [
    "ROD",
    "BoneFile",
    "Library",
    "PlacedBones",
    "bone_faults",
    "load_bones",
    "middle_inside",
    "place_bones",
    "read_library",
    "write_bone_file",
]
