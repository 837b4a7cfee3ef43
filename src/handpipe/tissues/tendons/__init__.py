"""Tendons: rods in tubes with hooks; a tendon over poses, and its layer."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.tissues.tendons import fitting, rods
    from handpipe.tissues.tendons.layer import CENTRELINE, TendonLayer
    from handpipe.tissues.tendons.straight_path import BonePath, bone_path
    from handpipe.tissues.tendons.tendon import RegisteredRods, Tendon, build_tendon
else:
    __getattr__ = face(__name__)

__all__ = [
    "CENTRELINE",
    "BonePath",
    "RegisteredRods",
    "Tendon",
    "TendonLayer",
    "bone_path",
    "build_tendon",
    "fitting",
    "rods",
]
