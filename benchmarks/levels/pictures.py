"""`python -m benchmarks.levels.pictures PART --output PNG`: the worst tested frames of each level.

Rows are frames; columns the skin as simulated, of L0 and of L1, and the organs of the same. With `--springs`
the skin and the organs as simulated and of L2, which is not learned. The part `creases` draws the finger's
held-out poses by the full model, by the uniform tissue and at L3.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.levels.creases import DATASET, Finger
from benchmarks.levels.measured import LEVELS
from benchmarks.levels.springs import spring_hand
from benchmarks.levels.subject import Subject
from handpipe.core import Frame, Shape
from handpipe.core.configuration import load_dataset
from handpipe.evaluation import camera_views, pictures
from handpipe.evaluation.rendering import Camera
from handpipe.hand import SimulatedFrame
from handpipe.mesh.surfaces import Surface

SIZE = (420, 420)  # pixels of a picture
WORST = 2  # frames of each level
SIDE = "thumb"  # view of folds
TITLES = ("simulated", "L0", "L1", "organs, simulated", "organs, L0", "organs, L1")


def main() -> None:
    """Draw the worst frames by the largest error of the skin."""
    parser = argparse.ArgumentParser(prog="benchmarks.levels.pictures", description=__doc__)
    parser.add_argument("part", choices=("finger", "hand", "creases"))
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of built subjects")
    parser.add_argument("--springs", action="store_true", help="level L2 and not the learned ones")
    parser.add_argument("--output", type=Path, required=True, help="PNG to be written")
    options = parser.parse_args()
    if options.part == "creases":
        FigureCanvasAgg(crease_sheet(Finger.built(options.results))).print_figure(options.output, dpi=100)
        return
    subject = Subject.built(options.part, options.results)
    frames = subject.tested_frames(len(subject.tested))
    if options.springs:
        FigureCanvasAgg(spring_sheet(subject, frames)).print_figure(options.output, dpi=100)
        return
    chosen: dict[str, str] = {}
    for level in LEVELS:
        errors = [_largest(subject, frame, level) for frame in frames]
        for i in np.argsort(errors)[::-1][:WORST]:
            chosen[frames[i][0].name] = f"{chosen.get(frames[i][0].name, '')} {level}: {errors[i]:.1f} mm"
    FigureCanvasAgg(sheet(subject, [f for f in frames if f[0].name in chosen], chosen)).print_figure(
        options.output, dpi=100
    )


def _largest(subject: Subject, frame: SimulatedFrame, level: str) -> float:
    found = subject.hand.frame(frame[0], level)["fat"]["skin"].vertices  # type: ignore[arg-type]
    return float(np.linalg.norm(found - frame[1]["fat"]["skin"].vertices, axis=1).max())


def sheet(subject: Subject, frames: list[SimulatedFrame], said: dict[str, str]) -> Figure:
    """All frames under one another."""
    figure = Figure(figsize=(6 * 2.6, len(frames) * 2.8), layout="constrained")
    for axes, (frame, layers) in zip(figure.subplots(len(frames), 6, squeeze=False), frames, strict=True):
        kinds = [dict(layers), *(subject.hand.frame(frame, level) for level in LEVELS)]
        camera = _camera(subject, frame, kinds[0])
        images = [pictures.outer_picture(kind, camera, SIZE) for kind in kinds]
        images += [pictures.inner_picture(kind, camera, SIZE) for kind in kinds]
        for number, (ax, image, title) in enumerate(zip(axes, images, TITLES, strict=True)):
            ax.imshow(image)
            ax.set_title(f"{frame.name}:{said[frame.name]}" if number == 0 else title, fontsize=8)
            ax.set_axis_off()
    return figure


def spring_sheet(subject: Subject, frames: list[SimulatedFrame]) -> Figure:
    """The worst frames of L2 by the largest error of the skin, beside the simulation."""
    hand = spring_hand(subject)
    found = [hand.frame(frame) for frame, _ in frames]
    errors = [
        float(np.linalg.norm(of["skin"]["skin"].vertices - layers["fat"]["skin"].vertices, axis=1).max())
        for of, (_, layers) in zip(found, frames, strict=True)
    ]
    figure = Figure(figsize=(4 * 2.6, WORST * 2.8), layout="constrained")
    worst = np.argsort(errors)[::-1][:WORST]
    for axes, i in zip(figure.subplots(WORST, 4, squeeze=False), worst, strict=True):
        (frame, layers), of = frames[i], found[i]
        camera = _camera(subject, frame, dict(layers))
        kinds = (dict(layers), of)
        images = [pictures.outer_picture(kind, camera, SIZE) for kind in kinds]
        images += [pictures.inner_picture(kind, camera, SIZE) for kind in kinds]
        titles = (f"{frame.name}: {errors[i]:.1f} mm", "L2", "organs, simulated", "organs, L2")
        for ax, image, title in zip(axes, images, titles, strict=True):
            ax.imshow(image)
            ax.set_title(title, fontsize=8)
            ax.set_axis_off()
    return figure


def crease_sheet(finger: Finger) -> Figure:
    """The skin in the held-out poses by the full model, by the uniform tissue and at L3."""
    poses = load_dataset(DATASET).heldout
    figure = Figure(figsize=(3 * 4.2, len(poses) * 4.2), layout="constrained")
    for axes, pose in zip(figure.subplots(len(poses), 3, squeeze=False), poses, strict=True):
        skin = finger.simulated(pose)["skin"]
        kinds = {**finger.built_skins(pose), "L3": Surface(skin.vertices, skin.cells)}
        layers = [{"skin": {"skin": Shape(s.vertices, s.vertices, s.triangles)}} for s in kinds.values()]
        views = camera_views(finger.rig, finger.frame(pose), "right")
        camera = Camera.fit(pictures.extent(layers[0]), *views[SIDE], SIZE)
        for ax, name, layer in zip(axes, kinds, layers, strict=True):
            ax.imshow(pictures.outer_picture(layer, camera, SIZE))
            ax.set_title(f"{pose}: {name}", fontsize=9)
            ax.set_axis_off()
    return figure


def _camera(subject: Subject, frame: Frame, layers: dict) -> Camera:  # type: ignore[type-arg]
    views = camera_views(subject.rig, frame, "right")
    return Camera.fit(pictures.extent(layers), *views["palm"], SIZE)


if __name__ == "__main__":
    main()
