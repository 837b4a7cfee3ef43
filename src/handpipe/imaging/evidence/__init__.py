"""What an image tells of tissue: profiles along normals, dark layers and tubes, markers, marrow."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.imaging.evidence import tubes
    from handpipe.imaging.evidence.markers import (
        MarkerSettings,
        boundary_markers,
        estimate_muscle_level,
        read_landmarks,
        read_markers,
        write_markers,
    )
    from handpipe.imaging.evidence.marrow_evidence import MarrowEvidence
    from handpipe.imaging.evidence.profiles import sample_profiles
    from handpipe.imaging.evidence.tubes import tube_surface
else:
    __getattr__ = face(__name__)

__all__ = [
    "MarkerSettings",
    "MarrowEvidence",
    "boundary_markers",
    "estimate_muscle_level",
    "read_landmarks",
    "read_markers",
    "sample_profiles",
    "tube_surface",
    "tubes",
    "write_markers",
]
