"""`python -m benchmarks.frames.seconds`: processor seconds of a scene's frames by layer, in one process.

Frames are simulated in their order and then backwards. The first one compiles kernels and builds what is
kept; the others cost what each further frame of a chunk costs. The same frame must come out the same twice.
With `--shapes` and `--against`, two states of the code are compared vertex by vertex.
"""

from __future__ import annotations

import argparse
import logging
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.threads import take_threads

if TYPE_CHECKING:  # loading it loads numba, which reads its number of threads then
    from handpipe.core import Array, Frame, Layer, Metrics, Shapes, SimulatedFrame

ROOT = Path(__file__).parents[2]

Costs = dict[str, float]  # processor seconds by layer


def main(arguments: Sequence[str] | None = None) -> None:
    """Simulate the frames, one line each, and write the figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.frames.seconds", description=__doc__)
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of built subjects")
    parser.add_argument("--subject", default="phantom-hand-preview", help="its name")
    parser.add_argument("--scene", type=Path, default=ROOT / "config/scenes/hand-preview.yaml", help="frames")
    parser.add_argument("--output", type=Path, required=True, help="JSON of the figures")
    parser.add_argument("--shapes", type=Path, help="npz that gets the vertices of all bodies")
    parser.add_argument("--against", type=Path, help="npz of another state of the code: how far bodies moved")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    take_threads(1)
    from handpipe.core import metrics

    start = time.process_time()
    layers, frames = scene_of(options.results / options.subject, options.scene, options.subject)
    loading = time.process_time() - start
    options.output.parent.mkdir(parents=True, exist_ok=True)
    figures, vertices = measured(layers, frames)
    if options.shapes is not None:
        np.savez(options.shapes, **vertices)  # type: ignore[arg-type]
    if options.against is not None:
        with np.load(options.against) as before:
            figures |= changes(vertices, before)
    metrics.write(options.output, {"load_seconds": (loading, "s"), **figures})


def scene_of(folder: Path, scene_file: Path, subject: str) -> tuple[list[Layer], list[Frame]]:
    """Layers and frames of a scene of a subject that is built in a folder."""
    from handpipe.core import Frame, artifacts_of
    from handpipe.core.configuration import load_dataset, load_scene
    from handpipe.hand import load_layers
    from handpipe.skeleton.drivers import read_frames
    from handpipe.skeleton.motion import expand_motion, is_motion
    from handpipe.skeleton.rig import Rig

    rig, dataset = Rig.load(folder / "rig.h5"), load_dataset(ROOT / f"config/datasets/{subject}.yaml")
    scene = load_scene(scene_file)
    files = [folder / path for path in artifacts_of(scene.needed, dataset)]
    file = ROOT / scene.frames
    if is_motion(file):
        poses = expand_motion(file, rig, hand=dataset.hand, recording=scene.recording).frames
    else:
        poses = read_frames(file, rig, hand=dataset.hand, bones=scene.bones)
    frames = [Frame(name, angles, rig.bone_transforms(angles)) for name, angles in poses.items()]
    return load_layers(scene.needed, dataset, files, rig.surfaces), frames


def measured(layers: Sequence[Layer], frames: Sequence[Frame]) -> tuple[Metrics, dict[str, Array]]:
    """Medians of the layers' seconds in all frames but the first, and how far equal frames are apart.

    Also vertices by "frame/layer/body".
    """
    order = [*frames, *reversed(frames[:-1])]
    found = [costs_of(frame, layers) for frame in order]
    first, further = found[0][0], [costs for costs, _ in found[1:]]
    figures: Metrics = {"first_seconds": (sum(first.values()), "s")}
    for name in first:
        figures[f"{name}_seconds"] = float(np.median([costs[name] for costs in further])), "s"
    figures["frame_seconds"] = float(np.median([sum(costs.values()) for costs in further])), "s"
    pairs = zip(found, reversed(found), strict=True)  # forwards and backwards
    figures["apart_max"] = max(apart(a, b) for (_, a), (_, b) in pairs), "mm"
    vertices = {
        f"{frame.name}/{layer}/{name}": shape.vertices
        for frame, (_, result) in zip(order, found, strict=True)
        for layer, shapes in result.items()
        for name, shape in shapes.items()
    }
    return figures, vertices


def changes(vertices: Mapping[str, Array], before: Mapping[str, Array]) -> Metrics:
    """Largest and mean distance in mm of a layer's vertices from those of another state of the code."""
    moved: dict[str, list[Array]] = {}
    for name, x in vertices.items():
        moved.setdefault(name.split("/")[1], []).append(np.linalg.norm(x - before[name], axis=1))
    figures: Metrics = {}
    for layer, lengths in moved.items():
        figures[f"{layer}_change_max"] = max(float(d.max(initial=0.0)) for d in lengths), "mm"
        figures[f"{layer}_change_mean"] = float(np.concatenate(lengths).mean()), "mm"
    return figures


def costs_of(
    frame: Frame, layers: Sequence[Layer], before: SimulatedFrame | None = None
) -> tuple[Costs, dict[str, Shapes]]:
    """Processor seconds of each layer of a frame, and its shapes by layer; after another one, if given."""
    from handpipe.core import FollowingLayer

    shapes: dict[str, Shapes] = {}
    costs: Costs = {}
    for layer in layers:
        start = time.process_time()
        below = {n: shapes[n] for n in layer.needs if n in shapes}
        if before is not None and isinstance(layer, FollowingLayer):
            shapes[layer.name] = layer.solve_after(before, frame, below)
        else:
            shapes[layer.name] = layer.solve(frame, below)
        costs[layer.name] = time.process_time() - start
    print(frame.name, ", ".join(f"{name} {seconds:.2f} s" for name, seconds in costs.items()), flush=True)
    return costs, shapes


def apart(a: Mapping[str, Shapes], b: Mapping[str, Shapes]) -> float:
    """Largest distance in mm of a vertex of any body in two results of one frame."""
    return max(
        float(np.linalg.norm(shape.vertices - b[layer][name].vertices, axis=1).max(initial=0.0))
        for layer, shapes in a.items()
        for name, shape in shapes.items()
    )


if __name__ == "__main__":
    main()
