"""The picture of a hand: whether a browser shows it, and its size."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from PIL import Image, ImageOps, UnidentifiedImageError

from handpipe.core import InputError

KINDS = {"JPEG": "image/jpeg", "PNG": "image/png", "WEBP": "image/webp"}  # that every browser shows


@dataclass(frozen=True)
class Picture:
    """A picture that a browser shows: its file, the kind of its content, and its upright size in pixels."""

    path: Path
    kind: str
    size: tuple[int, int]

    @staticmethod
    def read(path: Path) -> Picture:
        """Read a picture; raises `InputError` if it is missing, damaged or of another format."""
        remedy = "Give the picture as JPEG, PNG or WebP"
        if not path.is_file():
            raise InputError(path, "picture", "does not exist", remedy)
        try:
            with Image.open(path, formats=[*KINDS]) as image:
                kind = KINDS[str(image.format)]
                image.load()
                size = ImageOps.exif_transpose(image).size
        except (UnidentifiedImageError, OSError, SyntaxError, ValueError, Image.DecompressionBombError) as e:
            raise InputError(path, "picture", "cannot be read", remedy) from e
        return Picture(path, kind, size)
