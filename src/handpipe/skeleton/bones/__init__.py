"""Bones as artifacts hold them: surfaces, registered transforms, bones that move as one."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.skeleton.bones.bodies import moved_apart
    from handpipe.skeleton.bones.bone_files import read_registration, read_surfaces, write_surfaces
    from handpipe.skeleton.bones.registration_result import (
        Registration,
        read_registrations,
        write_registrations,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "Registration",
    "moved_apart",
    "read_registration",
    "read_registrations",
    "read_surfaces",
    "write_registrations",
    "write_surfaces",
]
