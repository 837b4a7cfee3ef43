"""Subjects with known truth: generated anatomy, simulated tissue, images as a scanner makes them."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.synthetic import (
        acquisition,
        continuum,
        coupled,
        family,
        generators,
        geometry,
        phantom,
        real_anatomy,
        rolling,
        sliding,
        template_hands,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "acquisition",
    "continuum",
    "coupled",
    "family",
    "generators",
    "geometry",
    "phantom",
    "real_anatomy",
    "rolling",
    "sliding",
    "template_hands",
]
