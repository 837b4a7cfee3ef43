"""Initial guesses of the separation: muscles of built poses, each moved by a random field of its own."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from handpipe.core import IntArray, Metrics, artifacts
from handpipe.core.metrics import summary
from handpipe.fem.solver import largest
from handpipe.mesh.surfaces import Distance, Surface, concatenate, each_moved
from handpipe.skeleton.bones import read_registration
from handpipe.skeleton.rig import Rig
from handpipe.synthetic.geometry.varied_shapes import Variation
from handpipe.tissues.muscles.fitting import SoftBody
from handpipe.tissues.muscles.separation import contested, overlap
from handpipe.tissues.muscles.separation.disjoint_start import Inseparable, disjoint_start

NOTHING: IntArray = np.zeros(0, dtype=np.int64)
Scene = tuple[dict[str, SoftBody], dict[str, Surface]]  # muscles and bones in a pose


@dataclass(frozen=True)
class Result:
    """Margin in mm within which attached vertices were released (infinite if no guess was found), largest
    motion of a vertex in mm, processor time in seconds.
    """

    margin: float
    moved: float
    seconds: float


def scenes(subject: Path) -> Iterator[tuple[str, Scene]]:
    """Each pose of a subject's folder that muscles were extracted from, before the separation."""
    rig = Rig.load(subject / "rig.h5")
    groups = artifacts.read(subject / "muscles/neutral.h5", "muscle_bodies")
    bodies = {name: SoftBody.from_group(group).on_bones(rig.surfaces) for name, group in groups.items()}
    for pose, shapes in artifacts.read(subject / "muscles/shapes.h5", "muscle_shapes").items():
        to = read_registration(subject / f"registration/{pose}.h5", rig.surfaces)
        posed = {n: b.posed(shapes[n]["vertices"], to) for n, b in bodies.items()}
        yield pose, (posed, each_moved(rig.surfaces, to))


def varied(scene: Scene, seed: int, size: float) -> Scene:
    """The scene, each muscle moved by `size` mm (standard deviation of a component), none of it on bones."""
    muscles, bones = scene
    near = Distance(concatenate([*bones.values()]))
    fields = {name: Variation(seed, name, size, near) for name in muscles}
    return {
        n: replace(b, surface=b.surface.moved(fields[n](b.surface.vertices))) for n, b in muscles.items()
    }, bones


def initial_guess(scene: Scene) -> Result:
    """Find an initial guess without intersections, with attachments released as in the pipeline."""
    muscles, bones = scene
    fixed = [overlap.Collider(n, s, NOTHING, fixed=True) for n, s in bones.items()]
    start = time.process_time()

    def start_with(margin: float) -> Result:
        attached = contested.drop_contested(muscles, 0, margin)
        bodies = [overlap.Collider(n, b.surface, attached[n].attached_vertices) for n, b in muscles.items()]
        found = disjoint_start(bodies, fixed) or [b.surface.vertices for b in bodies]
        moved = max(largest(x - b.surface.vertices) for x, b in zip(found, bodies, strict=True))
        return Result(margin, moved, time.process_time() - start)

    try:
        return contested.with_least_margin(start_with)
    except Inseparable:
        return Result(np.inf, np.inf, time.process_time() - start)


def figures(results: list[Result]) -> Metrics:
    """Counts of scenes, and the motion of muscles in successful scenes."""
    done = [r for r in results if np.isfinite(r.moved)]
    found: Metrics = {
        "scenes": (float(len(results)), "1"),
        "scenes_failed": (float(len(results) - len(done)), "1"),
        "scenes_with_released_attachments": (float(sum(r.margin > contested.CLEAR for r in done)), "1"),
    }
    found |= summary("moved", [r.moved for r in done], "mm") if done else {}
    return found | summary("seconds", [r.seconds for r in results], "s")
