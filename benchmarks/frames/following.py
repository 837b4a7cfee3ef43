"""`python -m benchmarks.frames.following`: frames from their own start and from the frame before.

Each frame of a motion is simulated in both ways, one after the other, in one process. The figures are
processor seconds by layer, how far the two shapes are apart, and how evenly the skin moves over the frames.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.frames.seconds import ROOT, costs_of, scene_of
from benchmarks.threads import take_threads

if TYPE_CHECKING:  # loading it loads numba, which reads its number of threads then
    from handpipe.core import Array, Frame, Layer, Metrics, Shapes


def main(arguments: Sequence[str] | None = None) -> None:
    """Simulate the frames, two lines each, and write the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.frames.following", description=__doc__)
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of built subjects")
    parser.add_argument("--subject", default="phantom-hand-preview", help="its name")
    parser.add_argument("--scene", type=Path, default=ROOT / "config/scenes/close-fist.yaml", help="motion")
    parser.add_argument("--first", type=int, default=0, help="number of the first frame, from 0")
    parser.add_argument("--count", type=int, default=8, help="frames, three or more")
    parser.add_argument("--output", type=Path, required=True, help="JSON of the figures")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    take_threads(1)
    from handpipe.core import metrics

    layers, frames = scene_of(options.results / options.subject, options.scene, options.subject)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    chosen = frames[options.first : options.first + options.count]
    metrics.write(options.output, followed(layers, chosen))


def followed(layers: Sequence[Layer], frames: Sequence[Frame]) -> Metrics:
    """Medians over all frames but the first, which compiles kernels and follows none."""
    costs, after = [], []
    alone = [costs_of(frames[0], layers)[1]]
    follows = [*alone]
    for last, frame in zip(frames[:-1], frames[1:], strict=True):
        spent, shapes = costs_of(frame, layers)
        costs.append(spent)
        alone.append(shapes)
        spent, shapes = costs_of(frame, layers, (last, follows[-1]))
        after.append(spent)
        follows.append(shapes)
    figures: Metrics = {"frames": (len(frames), "1")}
    for name in costs[0]:
        figures[f"{name}_seconds"] = float(np.median([spent[name] for spent in costs])), "s"
        figures[f"{name}_seconds_after"] = float(np.median([spent[name] for spent in after])), "s"
        apart = np.concatenate([_apart(a[name], b[name]) for a, b in zip(alone, follows, strict=True)])
        figures[f"{name}_apart_max"] = float(apart.max(initial=0.0)), "mm"
        figures[f"{name}_apart_mean"] = float(apart.mean()), "mm"
    figures["frame_seconds"] = float(np.median([sum(spent.values()) for spent in costs])), "s"
    figures["frame_seconds_after"] = float(np.median([sum(spent.values()) for spent in after])), "s"
    ratios = [sum(b.values()) / sum(a.values()) for a, b in zip(costs, after, strict=True)]
    figures["frame_ratio"] = float(np.median(ratios)), "1"
    outer = layers[-1].name
    figures["uneven_max"] = uneven([shapes[outer]["skin"].vertices for shapes in alone]), "mm"
    figures["uneven_max_after"] = uneven([shapes[outer]["skin"].vertices for shapes in follows]), "mm"
    return figures


def uneven(shapes: Sequence[Array]) -> float:
    """Largest distance in mm of a vertex (n, 3) from the middle between its places before and after."""
    middles = [x - 0.5 * (a + b) for a, x, b in zip(shapes[:-2], shapes[1:-1], shapes[2:], strict=True)]
    return float(np.linalg.norm(np.concatenate(middles), axis=1).max())


def _apart(a: Shapes, b: Shapes) -> Array:
    """Distances (n,) in mm of the vertices of a layer's bodies in two results."""
    return np.concatenate([np.linalg.norm(a[name].vertices - b[name].vertices, axis=1) for name in a])


if __name__ == "__main__":
    main()
