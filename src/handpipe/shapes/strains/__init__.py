"""Fields of plastic strains over tets: logarithm, frames, smoothness, few smooth fields."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.shapes.strains.stretch import COUNTS, StretchField
else:
    __getattr__ = face(__name__)

__all__ = ["COUNTS", "StretchField"]
