"""`python -m benchmarks.scans.picture PICTURE`: contours of the real foot on slices of three echoes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from PIL import Image

from benchmarks.scans.foot import Segmented, foot

SLICES = ((0, 50), (0, 42), (0, 36), (1, 114))  # axis and voxel, RAS
ECHO_TIMES = ("3.45 ms", "4.60 ms", "5.75 ms")
COLOURS = 128  # of the file


def draw(echoes: Sequence[Segmented], labels: Sequence[str], output: Path) -> None:
    """One row a slice, one column an echo; a bone in doubt has a dashed contour."""
    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(len(SLICES), len(echoes), figsize=(9.6, 10.4), squeeze=False)
    for row, (axis, at) in zip(axes, SLICES, strict=True):
        for place, echo in zip(row, echoes, strict=True):
            _panel(place, echo, labels, axis, at)
    for place, time in zip(axes[0], ECHO_TIMES, strict=False):
        place.set_title(time, fontsize=9)
    figure.tight_layout(pad=0.3)
    figure.savefig(output, dpi=80)
    pyplot.close(figure)
    Image.open(output).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(output, optimize=True)


def _panel(place: Axes, echo: Segmented, labels: Sequence[str], axis: int, at: int) -> None:
    """A slice with contours."""
    image = np.take(echo.volume.values, at, axis).T
    bright = float(np.percentile(image, 99))
    place.imshow(image, cmap="gray", origin="lower", interpolation="bicubic", vmax=bright)
    colours = matplotlib.colormaps["hsv"]
    for number, name in enumerate(labels):
        inside = np.take(_whole(echo, name), at, axis).T
        if name in echo.bones and inside.any():
            style = "dashed" if name in echo.doubts else "solid"
            colour = colours(number / len(labels))
            place.contour(inside, [0.5], colors=[colour], linewidths=1.6, linestyles=style)
    rows, columns = np.nonzero(image > 0.1 * bright)
    place.set_xlim(columns.min(), columns.max())
    place.set_ylim(rows.min(), rows.max())
    place.axis("off")


def _whole(echo: Segmented, name: str) -> NDArray:
    """The bone's probability on the whole grid."""
    out = np.zeros(echo.volume.shape, np.float32)
    if name in echo.bones:
        out[echo.bones[name].slices] = echo.bones[name].probability
    return out


if __name__ == "__main__":
    volumes, seeds, table = foot()
    draw([Segmented.measure(volume, seeds, table) for volume in volumes], list(table), Path(sys.argv[1]))
