"""Draw a simulated frame and its inside: python -m handpipe.develop.picture FRAMES.h5 FRAME PICTURE.png."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from PIL import Image as images

from handpipe.core import InputError, Parser, Shapes, atomic, reported
from handpipe.evaluation import Camera, Drawable, Image, bodies, on_background, render
from handpipe.hand import read_frames

WITHOUT = ("bone_fascia", "muscle_fascia")  # translucent cloths, which cover the organs
GHOST = 0.18  # opacity of the skin around the inside


def views(layers: Mapping[str, Shapes], size: tuple[int, int], direction: Sequence[float]) -> list[Image]:
    """Pictures (h, w, 3) of the skin and of the organs inside a translucent skin.

    Parameters
    ----------
    layers : mapping of str to Shapes
        Shapes of one frame by layer.
    size : (int, int)
        Width and height of each picture in pixels.
    direction : sequence of float
        Direction of the view, subject frame.
    """
    organs = {name: shapes for name, shapes in layers.items() if name not in WITHOUT}
    outside, inside = bodies(layers, skin_opacity=1.0), bodies(organs, skin_opacity=GHOST)
    camera = Camera.fit(outside, np.asarray(direction, float), np.array([0.0, 0.0, 1.0]), size)
    return [_drawn(seen, camera, size) for seen in (outside, inside)]


def _drawn(seen: Sequence[Drawable], camera: Camera, size: tuple[int, int]) -> Image:
    return on_background(render(seen, camera, size))


def main(arguments: list[str] | None = None) -> int:
    """Draw one frame of a file of frames side by side, without and with its inside; return the exit code."""
    parser = Parser(prog="python -m handpipe.develop.picture", description=__doc__)
    parser.add_argument("frames", type=Path, help="simulation/{scene}/frames-*.h5")
    parser.add_argument("frame", help="name of the frame")
    parser.add_argument("picture", type=Path, help="PNG file")
    parser.add_argument("--direction", type=float, nargs=3, default=(0.25, -0.9, 0.35))
    options = parser.parse_args(arguments)
    with reported() as failure:
        pictures = views(_frame(options.frames, options.frame), (480, 340), options.direction)
        with atomic(options.picture) as temporary:
            images.fromarray(np.concatenate(pictures, axis=1)).save(temporary, optimize=True)
    return failure.code


def _frame(path: Path, name: str) -> dict[str, Shapes]:
    found = {frame.name: layers for frame, layers in read_frames(path)}
    if name not in found:
        raise InputError(path, name, "is not in this file", f"Give one of {', '.join(sorted(found))}")
    return found[name]


if __name__ == "__main__":
    raise SystemExit(main())
