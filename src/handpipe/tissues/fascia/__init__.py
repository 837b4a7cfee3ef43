"""Fasciae: cloths around bones and around muscles, and their layers."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.tissues.fascia.fascia import ClothSettings, Fascia
    from handpipe.tissues.fascia.regions import muscle_regions, read_regions
    from handpipe.tissues.fascia.wrapping import bone_wrap, wrap
else:
    __getattr__ = face(__name__)

__all__ = ["ClothSettings", "Fascia", "bone_wrap", "muscle_regions", "read_regions", "wrap"]
