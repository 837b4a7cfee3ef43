"""`python -m benchmarks.scans.knee_picture RESULTS PICTURE`: slices with contours, and the bent leg."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image

from benchmarks.scans.knee_build import BENT, SETS, STRAIGHT, Knee
from benchmarks.scans.knee_skin import bent_skin
from handpipe.core import Array
from handpipe.imaging.volumes import Volume
from handpipe.mesh.surfaces import Distance, Surface, each_moved

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

COLOURS = {"femur": "#ff5a4f", "tibia": "#3fd0ff", "fibula": "#7dff6b", "patella": "#ffe04a"}
SLICES = (0.36, 0.64)  # of the second axis: through the two condyles
COLOUR_COUNT = 128  # of the picture: a small file
BRIGHT = 99.0  # percentile that is white


def draw(results: Path, picture: Path) -> None:
    """Rows: two slices. Columns: straight, bent by its own segmentation, bent as simulated from straight."""
    knee = Knee.build(results / f"knee-{SETS[0]}", SETS[0])
    bent = bent_skin(knee)
    root = bent.rig.poses[BENT].root
    motions = {bone: root @ moved for bone, moved in bent.rig.scanned_bones(BENT).items()}
    simulated = bent.simulated.moved(root(bent.simulated.vertices))
    whole = {bone: bent.rig.surfaces[bone] for bone in motions}
    figure, panels = pyplot.subplots(2, 3, figsize=(9.6, 6.6))
    columns = (
        (STRAIGHT, "straight, from strokes", knee.surfaces(STRAIGHT), None),
        (BENT, "bent, from proposed seeds", knee.surfaces(BENT), None),
        (BENT, "bent: simulated over its image", each_moved(whole, motions), simulated),
    )
    for row, share in zip(panels, SLICES, strict=True):
        for panel, (pose, title, bones, skin) in zip(row, columns, strict=True):
            _panel(panel, knee.volume(pose), share, bones, skin)
            if row is panels[0]:
                panel.set_title(title, fontsize=9)
    figure.tight_layout(pad=0.3)
    figure.savefig(picture, dpi=80)
    pyplot.close(figure)
    with Image.open(picture) as drawn:
        few = drawn.convert("RGB").quantize(COLOUR_COUNT)
    few.save(picture, optimize=True)


def _panel(
    panel: pyplot.Axes, volume: Volume, share: float, bones: Mapping[str, Surface], skin: Surface | None
) -> None:
    """One slice across the second axis with the surfaces' contours."""
    number = round(share * volume.shape[1])
    values = volume.values[::-1, number]
    panel.imshow(values.T, origin="lower", cmap="gray", vmax=float(np.percentile(volume.values, BRIGHT)))
    places = np.indices((volume.shape[0], 1, volume.shape[2])).reshape(3, -1).T + [0, number, 0]
    points = volume.to_world(places)
    for bone, surface in bones.items():
        _contour(panel, surface, points, values.shape, COLOURS[bone])
    if skin is not None:
        _contour(panel, skin, points, values.shape, "#ff9df2")
    panel.set_axis_off()


def _contour(
    panel: pyplot.Axes, surface: Surface, points: Array, shape: tuple[int, ...], colour: str
) -> None:
    signed = Distance(surface).signed(points)[0].reshape(shape)[::-1]
    if signed.min() < 0 < signed.max():
        panel.contour(signed.T, [0.0], colors=colour, linewidths=1.0)


if __name__ == "__main__":
    draw(Path(sys.argv[1]), Path(sys.argv[2]))
