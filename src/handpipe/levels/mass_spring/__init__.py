"""Hands of bulging muscles and a skin of springs, which need no simulated frames (Albrecht 2003)."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.levels.mass_spring.equilibrium import MassSpring, Settled
    from handpipe.levels.mass_spring.geometric_muscle import Bulge, GeometricMuscle
    from handpipe.levels.mass_spring.learned_springs import learn_springs
    from handpipe.levels.mass_spring.spring_hand import Bulging, SpringHand, Stiffness
    from handpipe.levels.mass_spring.springs import Springs
else:
    __getattr__ = face(__name__)

__all__ = [
    "Bulge",
    "Bulging",
    "GeometricMuscle",
    "MassSpring",
    "Settled",
    "SpringHand",
    "Springs",
    "Stiffness",
    "learn_springs",
]
