"""Movies as animated WebP, which every browser plays."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from PIL import Image as images

from handpipe.core import atomic
from handpipe.evaluation.rendering.window import Image

QUALITY = 85  # of 100, lossy


def write_movie(path: str | Path, pictures: Iterable[Image], count: int, fps: float = 24.0) -> None:
    """Write pictures as one animated WebP that repeats.

    The encoder takes each picture as soon as it is drawn: two are in memory at most, and the encoded movie.

    Parameters
    ----------
    path : path
        File to be written.
    pictures : iterable of array (h, w, 3)
        Pictures of one size in the order of time.
    count : int
        How many there are, one or more.
    fps : float
        Pictures per second; each is shown for a whole number of ms.

    Raises
    ------
    ValueError
        If there are fewer pictures than `count`.
    """
    coming = iter(pictures)
    first = images.fromarray(next(coming))
    with atomic(path) as temporary:
        first.save(
            temporary,
            format="WEBP",
            save_all=True,
            append_images=[_Film(coming, count - 1)] if count > 1 else [],
            duration=round(1000 / fps),
            loop=0,
            quality=QUALITY,
            minimize_size=False,
            allow_mixed=False,
        )


class _Film:
    """Pictures as one image of many frames, each drawn when the encoder seeks it: Pillow keeps lists."""

    def __init__(self, coming: Iterator[Image], count: int) -> None:
        self.n_frames = count
        self._coming = coming
        self._shown = images.Image()

    def seek(self, frame: int) -> None:
        """Go on to the next picture; frames are sought in their order."""
        picture = next(self._coming, None)
        if picture is None:
            raise ValueError(f"{frame + 1} pictures in place of {self.n_frames + 1}")
        self._shown = images.fromarray(picture)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._shown, name)
