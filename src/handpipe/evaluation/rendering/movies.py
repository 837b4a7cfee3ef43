"""Movies as animated WebP, which every browser plays."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from PIL import Image as images

from handpipe.core import atomic
from handpipe.evaluation.rendering.window import Image

QUALITY = 85  # of 100, lossy


def write_movie(path: str | Path, pictures: Iterable[Image], fps: float = 24.0) -> None:
    """Write pictures as one animated WebP that repeats.

    Parameters
    ----------
    path : path
        File to be written.
    pictures : iterable of array (h, w, 3)
        Pictures of one size, at least one, in the order of time.
    fps : float
        Pictures per second; each is shown for a whole number of ms.
    """
    first, *others = [images.fromarray(picture) for picture in pictures]
    with atomic(path) as temporary:
        first.save(
            temporary,
            format="WEBP",
            save_all=True,
            append_images=others,
            duration=round(1000 / fps),
            loop=0,
            quality=QUALITY,
            minimize_size=False,
            allow_mixed=False,
        )
