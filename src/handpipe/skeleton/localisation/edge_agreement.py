"""How well a moved marrow surface agrees with an image's edges, and its free motion onto them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import RigidTransform
from handpipe.imaging.evidence import sample_profiles
from handpipe.imaging.volumes import Volume
from handpipe.skeleton.localisation.bone_probes import MovingBones, Probes
from handpipe.skeleton.registration.edge_refinement import steepest_falls
from handpipe.skeleton.registration.normal_equations import Rows, moved, robust_weights, solve

REACHES = (
    1.4,
    1.4,
    1.4,
    1.0,
    1.0,
    1.0,
    0.8,
    0.8,
)  # mm either side in which edges are searched for, by iteration
EDGE_NOISE = 0.2  # mm, of an edge
INDEPENDENT = 60  # edges that tell something of their own; neighbours share their errors
PRIOR = (0.07, 1.0)  # rad and mm by which a bone may depart from where the search found it
OFFSETS = np.linspace(-1.2, 1.2, 17)  # mm along a profile
NEAR = 0.45  # mm from the surface at which an edge agrees, or most of a voxel
FALL, BRIGHT = 0.3, 0.65  # levels: the least fall from marrow to shell, and the least marrow
OF_VOXEL = 0.7  # of a voxel's longest edge, to which that limit grows
MARROW = (-1.0, -0.4)  # mm: where a profile shows the marrow
FEWEST_EDGES = 12  # with which a bone is moved


@dataclass(frozen=True)
class Agreement:
    """How well the edges of an image agree with the probes of a bone.

    Attributes
    ----------
    share : float
        Share of the probes inside the image whose edge is where the surface is.
    seen : float
        Share of all probes that are inside the image.
    offset : float
        Median offset in mm of the edges from the surface.
    """

    share: float
    seen: float
    offset: float


def agreement(image: Volume, probes: Probes, transform: RigidTransform) -> Agreement:
    """Agreement of moved probes with an image in units of the local marrow level."""
    points, outwards = transform(probes.points), probes.normals @ transform.rotation.T
    index = image.to_index(points)
    seen = ((index >= 0) & (index <= np.array(image.shape) - 1)).all(axis=1)
    if not seen.any():
        return Agreement(0.0, 0.0, 0.0)
    profiles = sample_profiles(image, points[seen], outwards[seen], OFFSETS)
    inside = profiles[:, (MARROW[0] < OFFSETS) & (MARROW[1] > OFFSETS)].mean(axis=1)
    fall = inside - profiles[:, OFFSETS >= 0].min(axis=1)
    offset, contrast = steepest_falls(image, points[seen], outwards[seen], float(OFFSETS[-1]))
    clear = (fall > FALL) & (inside > BRIGHT) & (contrast > 0)
    typical = float(np.median(offset[clear])) if clear.any() else 0.0
    near = np.abs(offset - typical) < max(NEAR, OF_VOXEL * float(image.spacing.max()))
    return Agreement(float((clear & near).mean()), float(seen.mean()), typical)


def onto_edges(image: Volume, body: MovingBones, start: RigidTransform, *, prior: bool) -> RigidTransform:
    """A motion of a body that brings its marrow onto the image's steepest falls.

    Parameters
    ----------
    image : Volume
        Image of the pose in units of the local marrow level.
    body : MovingBones
        Bones that move as one.
    start : RigidTransform
        Initial guess.
    prior : bool
        Whether the start is a prior, as a joint's prediction is where edges leave a rotation undetermined.

    Returns
    -------
    RigidTransform
        Transform from neutral, mm.
    """
    probes, transform = body.probes, start
    for reach in REACHES:
        points, outwards = transform(probes.points), probes.normals @ transform.rotation.T
        offset, contrast = steepest_falls(image, points, outwards, reach)
        if (contrast > 0).sum() < FEWEST_EDGES:
            return start
        typical = np.median(offset[contrast > 0])
        weights = contrast * robust_weights(offset - typical)
        common = (weights @ offset) / max(float(weights.sum()), 1e-9)
        middle = transform(body.middle)
        rows = Rows.build(points, outwards, offset - common, middle)
        if prior:
            rows = Rows.joined([rows, _pull(start, transform, body, float(weights.sum()))])
            weights = np.concatenate([weights, np.ones(6)])
        transform = moved(transform, solve(rows, weights), body.middle)
    return transform


def _pull(start: RigidTransform, transform: RigidTransform, body: MovingBones, count: float) -> Rows:
    """Rows that draw a motion to its start, with the weight of the prior against `count` edges."""
    turn = Rotation.from_matrix(start.rotation @ transform.rotation.T).as_rotvec()
    shift = start(body.middle) - transform(body.middle)
    strength = EDGE_NOISE * np.sqrt(max(count / INDEPENDENT, 1e-6)) / np.repeat(PRIOR, 3)
    return Rows(np.diag(strength), strength * np.concatenate([turn, shift]))
