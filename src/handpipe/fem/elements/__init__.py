"""Quantities of single tets: materials, plastic strains, compiled kernels, inversion."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.fem.elements import plasticity
    from handpipe.fem.elements.materials import (
        MODELS,
        Material,
        energy_densities,
        piola_stresses,
        semidefinite_stiffnesses,
        stiffnesses,
    )
    from handpipe.fem.elements.plasticity import polar
    from handpipe.fem.elements.strain_measures import green_strains, von_mises
    from handpipe.fem.elements.validity import Validity
else:
    __getattr__ = face(__name__)

__all__ = [
    "MODELS",
    "Material",
    "Validity",
    "energy_densities",
    "green_strains",
    "piola_stresses",
    "plasticity",
    "polar",
    "semidefinite_stiffnesses",
    "stiffnesses",
    "von_mises",
]
