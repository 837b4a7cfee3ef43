"""Potentials: elastic bodies, membranes, pulls, inertia, and the interface of all."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.fem.potentials.cloth import Membrane
    from handpipe.fem.potentials.elastic import Elastic, shape_gradients
    from handpipe.fem.potentials.expansion import Expansion
    from handpipe.fem.potentials.inertia import Inertia, mass_matrix
    from handpipe.fem.potentials.potential import Potential, Sum
    from handpipe.fem.potentials.pull import Pull
    from handpipe.fem.potentials.strain_derivatives import strain_gradient
    from handpipe.fem.potentials.viscosity import Viscosity
    from handpipe.fem.potentials.viscous_layer import Viscous
else:
    __getattr__ = face(__name__)

__all__ = [
    "Elastic",
    "Expansion",
    "Inertia",
    "Membrane",
    "Potential",
    "Pull",
    "Sum",
    "Viscosity",
    "Viscous",
    "mass_matrix",
    "shape_gradients",
    "strain_gradient",
]
