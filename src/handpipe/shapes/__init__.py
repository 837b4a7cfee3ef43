"""Shape from plastic strains: a template deformed to marks of an organ's boundary."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.shapes import observations, optimisation, organs, strains
else:
    __getattr__ = face(__name__)

__all__ = ["observations", "optimisation", "organs", "strains"]
