"""A tendon in the neutral image: from a clicked curve to its rod, radii and surface (sec. 5.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

from handpipe.core import Array
from handpipe.imaging.evidence import tubes
from handpipe.imaging.volumes import Volume
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.tissues.tendons.rods.rod import resample, tangents

SPACING = 1.2  # mm, length of a segment
SMOOTHING = 2.5  # mm; wiggles of the centres shorter than this are noise
ROUNDS = 8  # of centres and radii
CLEARANCE = 0.5  # of the radius that a tendon's centre keeps from bone at least
LEAST_WEIGHT = 1e-3  # of a section that was not found


@dataclass(frozen=True)
class NeutralTendon:
    """A tendon as the neutral image shows it.

    Parameters
    ----------
    x : array (Q+1, 3)
        Rod in mm, from the insertion outwards.
    radii : array (Q+1,)
        Radii in mm.
    confidence : array (Q+1,)
        Confidence of each vertex's section.
    surface : Surface
        The tendon's surface in mm.
    """

    x: Array
    radii: Array
    confidence: Array
    surface: Surface


def smoothed(values: Array, weights: Array, spacing: float, length: float) -> Array:
    """Smoothing spline: values (n, d) weighted by (n,), wiggles shorter than `length` mm damped.

    Minimises sum w (y - v)^2 + (length / spacing)^4 |second differences of y|^2.
    """
    n, stiffness = len(values), (length / spacing) ** 4
    bands = np.zeros((3, n))
    bands[2] = weights
    for a, left in enumerate((1.0, -2.0, 1.0)):
        for b, right in enumerate((1.0, -2.0, 1.0)):
            if b >= a:
                bands[2 - (b - a), b : n - 2 + b] += stiffness * left * right
    return solveh_banded(bands, weights[:, None] * values)


def extract(
    volume: Volume, clicked: Array, radius: float, bones: Distance | None = None, spacing: float = SPACING
) -> NeutralTendon:
    """The rod, radii and surface of the dark tube along clicked points.

    The ends keep their place along the tendon, as they were clicked; across it they move to the tube's
    centre.

    Parameters
    ----------
    volume : Volume
        The neutral image.
    clicked : array (k, 3)
        Points on the tendon in mm, the insertion first.
    radius : float
        Approximate radius in mm.
    bones : Distance, optional
        Distance to the whole bones (with cortex) in this image. Edges towards bones are not trusted.
    spacing : float
        Length of a segment in mm, about.

    Returns
    -------
    NeutralTendon
        Rod, radii, confidence and surface.

    Raises
    ------
    InputError
        Where a point lies outside the volume.
    """
    curve = tubes.trace(volume, clicked)
    curve = np.vstack([clicked[:1], curve[np.linalg.norm(curve - clicked[0], axis=1) > spacing]])
    x = resample(curve, spacing)
    for _ in range(ROUNDS):
        found = tubes.darkness_centre(volume, x, tangents(x), radius, bones, iterations=1)
        x = resample(_through_centres(x, found, spacing), spacing)
    found = tubes.darkness_centre(volume, x, tangents(x), radius, bones)
    radii = smoothed(found.radii[:, None], found.confidence + LEAST_WEIGHT, spacing, 2.0 * SMOOTHING)[:, 0]
    return NeutralTendon(x, radii, found.confidence, tubes.tube_surface(volume, x, radius, bones))


def _through_centres(x: Array, found: tubes.Sections, spacing: float) -> Array:
    weights = found.confidence + LEAST_WEIGHT
    return smoothed(found.centres, weights, spacing, SMOOTHING)


def centre_finder(volume: Volume, radius: float, bones: Distance | None = None) -> Callable:
    """The function that finds a tendon's centres in one image, for `register`.

    Points in or on bone are moved out of it first: rays from within a bone see no tendon.

    Parameters
    ----------
    volume : Volume
        The image.
    radius : float
        Approximate radius in mm.
    bones : Distance, optional
        Distance to the bones in this image.

    Returns
    -------
    callable
        `find_centres(points, tangents) -> (centres, confidence)`: from arrays (n, 3) to (n, 3) in mm and
        (n,); confidence is zero outside of the volume.
    """

    def find(points: Array, along: Array) -> tuple[Array, Array]:
        if bones is not None:
            outside, _, _, normals = bones.signed(points)
            points = points + np.maximum(CLEARANCE * radius - outside, 0.0)[:, None] * normals
        found = tubes.darkness_centre(volume, points, along, radius, bones, iterations=1)
        inside = np.all(
            (volume.to_index(points) >= 0) & (volume.to_index(points) <= np.array(volume.shape) - 1), axis=1
        )
        return found.centres, np.where(inside, found.confidence, 0.0)

    return find
