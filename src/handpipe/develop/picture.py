"""Draw a simulated frame, or a volume: python -m handpipe.develop.picture FRAMES.h5 FRAME PICTURE.png.

A frame: its skin, the organs inside it, and the hand cut open through its middle. A volume (NIfTI, NRRD,
DICOM) in place of the frames and `anatomy` or `fat` in place of the frame: its volume rendering by that
transfer function, seen along the direction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from PIL import Image as images

from handpipe.core import Array, Frame, InputError, Parser, Shapes, atomic, reported
from handpipe.evaluation import VIEWS, camera_views, cut_picture, extent, inner_picture, outer_picture
from handpipe.evaluation.rendering import (
    TRANSFERS,
    Camera,
    Cut,
    Image,
    render_volume,
    volume_extent,
)
from handpipe.hand import read_frames
from handpipe.imaging.volumes import read_volume
from handpipe.skeleton.rig import Rig

SIZE = (480, 480)  # pixels of a picture
UP = (0.0, 0.0, 1.0)  # dorsal in the phantoms: upwards in a picture


def views(layers: Mapping[str, Shapes], size: tuple[int, int], direction: Array, up: Array) -> list[Image]:
    """Pictures (h, w, 3) of the skin, of the organs inside a translucent skin, and of the frame cut open.

    Parameters
    ----------
    layers : mapping of str to Shapes
        Shapes of one frame by layer.
    size : (int, int)
        Width and height of each picture in pixels.
    direction, up : array (3,)
        Direction of the view and the one that points upwards, subject frame. The cut is perpendicular to
        the view, through the mean vertex.
    """
    seen = extent(layers)
    camera = Camera.fit(seen, direction, up, size)
    cut = Cut(seen.mean(axis=0), -direction)
    outside, inside = outer_picture(layers, camera, size), inner_picture(layers, camera, size)
    return [outside, inside, cut_picture(layers, camera, size, cut)]


def main(arguments: list[str] | None = None) -> int:
    """Draw one frame of a file of frames, or a volume; return the exit code."""
    parser = Parser(prog="python -m handpipe.develop.picture", description=__doc__)
    parser.add_argument("frames", type=Path, help="simulation/{scene}/frames-*.h5, or a volume")
    parser.add_argument("frame", help="name of the frame; of a volume: anatomy or fat")
    parser.add_argument("picture", type=Path, help="PNG file")
    parser.add_argument("--direction", type=float, nargs=3, default=(0.25, -0.9, 0.35))
    parser.add_argument("--side", choices=tuple(VIEWS), help="of the hand, instead of a direction")
    parser.add_argument("--hand", choices=("right", "left"), default="right")
    options = parser.parse_args(arguments)
    with reported() as failure:
        if options.frames.suffix == ".h5":
            frame, layers = _frame(options.frames, options.frame)
            sight = np.array([options.direction, UP])
            if options.side:
                sight = _side(options.frames, frame, options.side, options.hand)
            pictures = views(layers, SIZE, *sight)
        else:
            pictures = [_volume(options.frames, options.frame, options.direction)]
        with atomic(options.picture) as temporary:
            images.fromarray(np.concatenate(pictures, axis=1)).save(temporary, format="png", optimize=True)
    return failure.code


def _side(path: Path, frame: Frame, side: str, hand: Literal["right", "left"]) -> Array:
    """Rows direction and up (2, 3) of a view from a side; the rig is in the subject's folder."""
    rig = Rig.load(path.absolute().parents[2] / "rig.h5")
    return np.array(camera_views(rig, frame, hand)[side])


def _frame(path: Path, name: str) -> tuple[Frame, dict[str, Shapes]]:
    found = {frame.name: (frame, layers) for frame, layers in read_frames(path)}
    if name not in found:
        raise InputError(path, name, "is not in this file", f"Give one of {', '.join(sorted(found))}")
    return found[name]


def _volume(path: Path, name: str, direction: Sequence[float]) -> Image:
    if name not in TRANSFERS:
        raise InputError(path, name, "is no transfer function", f"Give one of {', '.join(TRANSFERS)}")
    volume = read_volume(path)
    camera = Camera.fit(volume_extent(volume), np.asarray(direction, float), np.asarray(UP), SIZE)
    return render_volume(volume, TRANSFERS[name], volume.bright, camera, SIZE)


if __name__ == "__main__":
    raise SystemExit(main())
