"""Muscles of one pose without interpenetration (Zheng 2022 §4.3)."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.tissues.muscles.separation.contested import drop_contested, separate_posed
    from handpipe.tissues.muscles.separation.separation import NO_VOLUME, load_surfaces, separate
else:
    __getattr__ = face(__name__)

__all__ = ["NO_VOLUME", "drop_contested", "load_surfaces", "separate", "separate_posed"]
