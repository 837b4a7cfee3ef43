"""The picture of a hand: whether a browser shows it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from PIL import Image, UnidentifiedImageError

from handpipe.core import InputError

KINDS = {"JPEG": "image/jpeg", "PNG": "image/png", "WEBP": "image/webp"}  # that every browser shows


@dataclass(frozen=True)
class Picture:
    """A picture that a browser shows.

    Parameters
    ----------
    path : Path
        File.
    kind : str
        Kind of its content, as a server names it.
    """

    path: Path
    kind: str

    @staticmethod
    def read(path: Path) -> Picture:
        """Read a picture.

        Parameters
        ----------
        path : Path
            JPEG, PNG or WebP.

        Returns
        -------
        Picture
            Its file and kind.

        Raises
        ------
        InputError
            If it is missing, damaged or of another format.
        """
        remedy = "Give the picture as JPEG, PNG or WebP"
        if not path.is_file():
            raise InputError(path, "picture", "does not exist", remedy)
        try:
            with Image.open(path, formats=[*KINDS]) as image:
                kind = KINDS[str(image.format)]
                image.load()
        except (UnidentifiedImageError, OSError, SyntaxError, ValueError, Image.DecompressionBombError) as e:
            raise InputError(path, "picture", "cannot be read", remedy) from e
        return Picture(path, kind)
