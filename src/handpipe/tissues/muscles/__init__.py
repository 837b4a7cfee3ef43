"""Muscles: a body with plastic strains over poses, and the layer of all muscles."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.tissues.muscles import fitting, separation
    from handpipe.tissues.muscles.layer import MuscleLayer
    from handpipe.tissues.muscles.muscle import Examples, Muscle, SeparatedShape
    from handpipe.tissues.muscles.options import SimulationOptions
else:
    __getattr__ = face(__name__)

__all__ = [
    "Examples",
    "Muscle",
    "MuscleLayer",
    "SeparatedShape",
    "SimulationOptions",
    "fitting",
    "separation",
]
