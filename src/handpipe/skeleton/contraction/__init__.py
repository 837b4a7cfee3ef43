"""Pseudo muscles turn contractions into joint angles, and angles into contractions of little effort."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.skeleton.contraction.dynamics import HandState, MuscleDrive
    from handpipe.skeleton.contraction.forward import MusclePlay, angles_of_contractions
    from handpipe.skeleton.contraction.inverse import FoundContractions, contractions_of_angles
    from handpipe.skeleton.contraction.pseudo_muscles import PseudoMuscles, every_muscle
else:
    __getattr__ = face(__name__)

__all__ = [
    "FoundContractions",
    "HandState",
    "MuscleDrive",
    "MusclePlay",
    "PseudoMuscles",
    "angles_of_contractions",
    "contractions_of_angles",
    "every_muscle",
]
