"""Observations for a fit: marks of the boundary, attached points, the template's place and frame."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.shapes.observations.attached import Attached
    from handpipe.shapes.observations.correspondence import Markers, fixed_markers
else:
    __getattr__ = face(__name__)

__all__ = ["Attached", "Markers", "fixed_markers"]
