"""Bones: where they are in images, how joints move them, and the poses that a person asks for."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.skeleton import bones, drivers, joints, localisation, posing, registration, rig
else:
    __getattr__ = face(__name__)

__all__ = ["bones", "drivers", "joints", "localisation", "posing", "registration", "rig"]
