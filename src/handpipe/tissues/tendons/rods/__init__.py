"""Elastic rods and tubes around them: energies, equilibria, rest shapes."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.tissues.tendons.rods.rest import RestTendon
    from handpipe.tissues.tendons.rods.rod import length_change
    from handpipe.tissues.tendons.rods.tube import round_surface
else:
    __getattr__ = face(__name__)

__all__ = ["RestTendon", "length_change", "round_surface"]
