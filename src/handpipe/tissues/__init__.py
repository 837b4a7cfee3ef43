"""Soft tissues, one room each: how it is fitted, and its layer of the simulation."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.tissues import fascia, fat, ligaments, muscles, tendons
else:
    __getattr__ = face(__name__)

__all__ = ["fascia", "fat", "ligaments", "muscles", "tendons"]
