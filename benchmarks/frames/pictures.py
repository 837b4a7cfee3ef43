"""`python -m benchmarks.frames.pictures SUBJECT POSES`: a built subject's poses, a row each.

Columns: the skin, the organs from the palm and from the back, the scan's distance from the skin.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from handpipe.core.configuration import load_dataset
from handpipe.evaluation import camera_views, pictures
from handpipe.evaluation.rendering import Camera, Image
from handpipe.hand import read_frames
from handpipe.mesh.files import read_surface
from handpipe.skeleton.rig import Rig

SIZE = (360, 360)  # pixels of a picture
LARGEST = 1.0  # mm, yellow
TITLES = ("from the palm", "from the back", f"scan to skin, 0 to {LARGEST:g} mm")


def row(subject: str, pose: str, rig: Rig) -> list[Image]:
    """The pictures of a pose, all at one scale."""
    base, dataset = Path("results") / subject, load_dataset(f"config/datasets/{subject}.yaml")
    [(frame, layers)] = read_frames(base / f"poses/{pose}/inner.h5")
    [(_, skins)] = read_frames(base / f"poses/{pose}/skin.h5")
    layers = {**layers, "fat": skins["m0"]}
    skin, scan = pictures.skin_surface(layers), dataset.poses[pose].scan
    assert skin is not None and scan is not None
    scanned = read_surface(dataset.path(scan))
    scanned = scanned.moved(rig.poses[pose].root.inverse()(scanned.vertices))
    seen, views = pictures.extent(layers), camera_views(rig, frame, dataset.hand)
    palm, back = (Camera.fit(seen, *views[side], SIZE) for side in ("palm", "back"))
    return [
        pictures.outer_picture(layers, palm, SIZE),
        pictures.inner_picture(layers, palm, SIZE),
        pictures.inner_picture(layers, back, SIZE),
        pictures.error_picture(scanned, skin, palm, SIZE, LARGEST),
    ]


def sheet(subject: str, poses: list[str]) -> Figure:
    """All poses under one another."""
    rig = Rig.load(Path("results") / subject / "rig.h5")
    figure = Figure(figsize=(4 * 2.5, len(poses) * 2.6), layout="constrained")
    for axes, pose in zip(figure.subplots(len(poses), 4, squeeze=False), poses, strict=True):
        for ax, image, title in zip(axes, row(subject, pose, rig), (pose, *TITLES), strict=True):
            ax.imshow(image)
            ax.set_title(title, fontsize=8)
            ax.set_axis_off()
    return figure


def main() -> None:
    """Draw the poses asked for; run where `results` and `config` are."""
    parser = argparse.ArgumentParser(prog="benchmarks.frames.pictures", description=__doc__)
    parser.add_argument("subject", help="name of a built subject")
    parser.add_argument("poses", nargs="+", help="that were scanned")
    parser.add_argument("--output", type=Path, required=True, help="PNG to be written")
    options = parser.parse_args()
    FigureCanvasAgg(sheet(options.subject, options.poses)).print_figure(options.output, dpi=110)


if __name__ == "__main__":
    main()
