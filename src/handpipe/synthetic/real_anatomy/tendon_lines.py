"""Middle lines of a hand's long tendons, from the points of a muscle's surface that has one tail a ray."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from handpipe.anatomy.person import SubjectTemplate, TemplateTendon
from handpipe.core import Array
from handpipe.mesh.surfaces import Distance, arclength, resample
from handpipe.synthetic.real_anatomy import real_hand

BIN = 3.0  # mm along a tendon over which its middle is taken
BESIDE = 16.0  # mm from a ray's middle line to the points of its tendon
LINE = 200  # points of that line


def tendon_lines(
    points: Array, template: SubjectTemplate, kind: str, rays: Sequence[int]
) -> dict[str, TemplateTendon]:
    """The tails {kind}{ray} of points (n, 3) on all of them, each point with the ray that it is nearest to.

    The template has bones, joints and the feature points of fingertips.
    """
    lines = [_middle_line(ray, template) for ray in rays]
    distance, nearest = cKDTree(np.concatenate(lines)).query(points)
    owner, place = nearest // LINE, nearest % LINE
    found = {}
    for i, ray in enumerate(rays):
        step = arclength(lines[i])[-1] / (LINE - 1)
        mine = (owner == i) & (distance < BESIDE) & (place > 0)
        found[f"{kind}{ray}"] = _tendon(ray, points[mine], step * place[mine], template)
    return found


def _middle_line(ray: int, template: SubjectTemplate) -> Array:
    """From a metacarpal's base along its ray's joints to the fingertip."""
    centres = {joint.name: joint.centre for joint in template.joints}
    shaft = template.bones[f"metacarpal{ray}"].vertices.mean(axis=0)
    knuckles = [centres[f"{kind}{ray}"] for kind in ("MP", "PIP", "IP", "DIP") if f"{kind}{ray}" in centres]
    corners = [2 * shaft - knuckles[0], *knuckles, template.feature_points[f"tip{ray}"]]
    return resample(np.array(corners), LINE)


def _tendon(ray: int, points: Array, along: Array, template: SubjectTemplate) -> TemplateTendon:
    """The middle line of points (n, 3), from the last along the ray backwards, in steps of `BIN` mm."""
    path, radii = [points[np.argmax(along)]], []
    for at in np.arange(along.max() - BIN, along.min(), -BIN):
        ring = points[np.abs(along - at) < BIN]
        if len(ring):
            path.append(ring.mean(axis=0))
            radii.append(np.linalg.norm(ring - path[-1], axis=1).min())
    chain = real_hand.RAYS[ray][::-1]
    ends = [float(Distance(template.bones[bone]).closest(path[0][None])[0][0]) for bone in chain]
    chain = chain[int(np.argmin(ends)) :]
    return TemplateTendon(np.array(path), chain[0], chain, float(np.median(radii)))
