"""One minimisation by Newton's method: directions, convergence, rigid-body modes, records."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.fem.minimisation.record import Equilibrium, Record
else:
    __getattr__ = face(__name__)

__all__ = ["Equilibrium", "Record"]
