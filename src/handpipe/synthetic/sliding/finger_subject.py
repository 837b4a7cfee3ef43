"""The subject of the finger whose tissues slide: organs in a pose, and the files of a dataset.

Bones, ligaments and tendons move as the phantom finger's do; muscles, fat and skin are simulated.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from handpipe.core import Array, IntArray, artifacts
from handpipe.core.configuration import Dataset
from handpipe.synthetic.acquisition import scans
from handpipe.synthetic.acquisition.posed import PosedAnatomy, write_pose
from handpipe.synthetic.phantom.phantom_finger import finger, posture, write_templates
from handpipe.synthetic.phantom.phantom_skin import START, nail_share
from handpipe.synthetic.sliding.finger_bodies import build, muscles
from handpipe.synthetic.sliding.finger_poses import body_of, settle
from handpipe.synthetic.sliding.sliding_body import SlidingBody

KIND = "sliding-pose"
SMOOTHINGS = {
    "skin": 2,
    "muscle": 1,
}  # subdivisions (Loop 1987) of the simulated surfaces for images and truth
NEUTRAL = "neutral"
SPACING, MARGIN = 0.8, 6.0  # mm: voxels, and air around the finger


def save(path: str | Path, x: Array, inputs: Sequence[str | Path]) -> None:
    """Write a pose's node positions (n, 3) in mm (kind "sliding-pose"), root at rest."""
    artifacts.write(path, {"positions": x}, kind=KIND, units={"positions": "mm"}, inputs=inputs)


def load(path: str | Path) -> Array:
    """The positions (n, 3) of a pose."""
    return np.asarray(artifacts.read(path, KIND)["positions"])


def smooth(x: Array, faces: IntArray, subdivisions: int) -> tuple[Array, IntArray]:
    """A closed surface of faces (k, 3) of nodes x (n, 3), subdivided: a linear map of the nodes."""
    used, triangles = np.unique(faces, return_inverse=True)
    found = trimesh.remesh.subdivide_loop(x[used], triangles.reshape(-1, 3), iterations=subdivisions)
    return np.asarray(found[0], dtype=float), np.asarray(found[1], dtype=np.int64)


def posed(body: SlidingBody, pose: str, x: Array, seed: int) -> PosedAnatomy:
    """All organs in a pose of a dataset, whose root is repositioned; x (n, 3) in mm with the root at rest."""
    where = posture(pose, seed)
    known = finger().posed(where)
    placed = where.root(x)
    return replace(
        known,
        muscles={name: smooth(placed, body.faces_of(name), SMOOTHINGS["muscle"]) for name in body.muscles},
        skin=smooth(placed, body.outer, SMOOTHINGS["skin"]),
        nails={"nail2": (nail_of(skin_at_rest(body)), known.transforms["distal2"])},
    )


def skin_at_rest(body: SlidingBody) -> tuple[Array, IntArray]:
    """The skin's surface at rest, with the triangles that it has in each pose."""
    return smooth(body.rest, body.outer, SMOOTHINGS["skin"])


def nail_of(skin: tuple[Array, IntArray]) -> IntArray:
    """Numbers of the triangles of a skin at rest that are nail."""
    return np.flatnonzero((nail_share(skin[0]) > 0.5)[skin[1]].all(axis=1))


def write(dataset: Dataset, pose: str, body: SlidingBody, x: Array) -> None:
    """Write a pose's volume, seeds, scan, truth and label volumes where the dataset names them."""
    found = posed(body, pose, x, dataset.seed)
    rng = np.random.default_rng([dataset.seed, zlib.crc32(pose.encode()), 4])
    scan = scans.scan(skin_at_rest(body)[0], *found.skin, rng, open_before=START + 7.0)
    write_pose(dataset, pose, found, scan, spacing=SPACING, margin=MARGIN)


def generate_pose(dataset: Dataset, pose: str) -> None:
    """Simulate a pose and write its files; the workflow keeps the simulation in a file between the two.

    Raises
    ------
    ConvergenceError
        If the pose has no equilibrium.
    InputError
        For an unknown pose.
    """
    posture(pose, dataset.seed)
    body = body_of(build())
    x = settle(body, NEUTRAL).x
    write(dataset, pose, body, x if pose == NEUTRAL else settle(body, pose, x).x)


def generate_templates(dataset: Dataset) -> None:
    """Write what a person brings, as `phantom_finger.generate_templates` does."""
    skin = skin_at_rest(body_of(build()))
    write_templates(dataset, muscles(), skin, nail_of(skin))
