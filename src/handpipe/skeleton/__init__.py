"""Bones: where they are in images, how joints move them, poses that a person asks for, scans of the skin."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.skeleton import (
        bones,
        drivers,
        joints,
        localisation,
        posing,
        registration,
        rig,
        scan_alignment,
    )
else:
    __getattr__ = face(__name__)

__all__ = ["bones", "drivers", "joints", "localisation", "posing", "registration", "rig", "scan_alignment"]
