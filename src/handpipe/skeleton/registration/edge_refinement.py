"""Refinement of a registration by the image: where along the normals bright marrow turns into dark shell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from handpipe.core import Array
from handpipe.imaging.evidence import sample_profiles
from handpipe.imaging.volumes import Volume
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.bones.registration_result import Registration
from handpipe.skeleton.registration.normal_equations import Rows, covariance, moved, robust_weights, solve

REACH = (1.2, 0.7)  # mm either side of the surface in which the edge is searched for, at first and at last
SAMPLES = 17  # of a profile across the surface
ITERATIONS = 12  # half of them with the first reach, half with the last


def refine_to_edges(neutral: Surface, volume: Volume, found: Registration) -> Registration:
    """The registration moved so that the neutral marrow surface lies on the image's steepest falls.

    The surface may lie off the edges by a common distance, as one at another level of a blurred edge does:
    that distance is fitted together with the motion. rms in mm is that of the remaining distances.
    """
    middle, normals = neutral.vertices.mean(axis=0), neutral.vertex_normals()
    transform = found.transform
    for i in range(ITERATIONS):
        reach = REACH[0] if i < ITERATIONS // 2 else REACH[1]
        points, outwards = transform(neutral.vertices), normals @ transform.rotation.T
        offset, contrast = steepest_falls(volume, points, outwards, reach)
        typical = np.median(offset[contrast > 0])
        weights = contrast * robust_weights(offset - typical)
        common = (weights @ offset) / weights.sum()
        rows = Rows.build(points, outwards, offset - common, transform(middle))
        transform = moved(transform, solve(rows, weights), middle)
    rms = float(np.sqrt(weights @ rows.distance**2 / weights.sum()))
    return replace(
        found,
        transform=transform,
        rms=rms,
        covariance=covariance(rows, weights, neutral.edges(), neutral.vertices),
    )


def steepest_falls(volume: Volume, points: Array, directions: Array, reach: float) -> tuple[Array, Array]:
    """Offsets (n,) in mm along unit directions (n, 3) of the image's steepest falls, and confidences (n,).

    Confidences in [0, 1] are the fall's slope by the upper quartile of all; zero where the steepest fall
    lies at the end of the reach, or where nothing falls.
    """
    offsets = np.linspace(-reach, reach, SAMPLES)
    step = offsets[1] - offsets[0]
    fall = -np.gradient(sample_profiles(volume, points, directions, offsets), step, axis=1)
    best = fall.argmax(axis=1)
    inside = (best > 0) & (best < SAMPLES - 1)
    rows, middle = np.arange(len(points)), np.clip(best, 1, SAMPLES - 2)
    before, at, after = fall[rows, middle - 1], fall[rows, middle], fall[rows, middle + 1]
    bend = before - 2 * at + after
    shift = np.where(bend < 0, 0.5 * (before - after) / np.where(bend < 0, bend, -1.0), 0.0)
    slope = np.where(inside & (at > 0), at, 0.0)
    strong = max(float(np.quantile(slope, 0.75)), 1e-12)
    return offsets[middle] + step * np.clip(shift, -1, 1), np.minimum(slope / strong, 1.0)
