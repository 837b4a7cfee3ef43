"""Static equilibria of soft bodies: potentials, and the solver that minimises their sum."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.fem import contact, elements, linear, minimisation, patterns, potentials, solver
else:
    __getattr__ = face(__name__)

__all__ = ["contact", "elements", "linear", "minimisation", "patterns", "potentials", "solver"]
