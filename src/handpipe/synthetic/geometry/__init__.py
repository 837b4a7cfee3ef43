"""Geometry of generated anatomy: implicit solids, tubes, chains of joints, warps, a toy leg."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.synthetic.geometry.leg import leg_surfaces
else:
    __getattr__ = face(__name__)

__all__ = ["leg_surfaces"]
