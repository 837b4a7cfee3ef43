"""The phantom's intrinsic muscles and ligaments: tubes of known shape, posed by maps that keep their volume.

Both muscles lie radially of the metacarpal. Their sections fill the two quadrants beyond a corner, which lies
beside the bone on their common contact plane: scaled about it, a section enters neither bone nor neighbour.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from handpipe.core import Array, IntArray
from handpipe.synthetic.geometry.implicit import Implicit
from handpipe.synthetic.geometry.kinematics import Posture, ramp, smoothstep
from handpipe.synthetic.geometry.tubes import close_rings, superellipse, volume

ORIGIN, INSERTION = 12.0, 75.5  # mm, x of both muscles' ends
TRANSITION = (40.0, 67.0)  # mm, x over which muscle passes from following the metacarpal to the phalanx


def contact_height(x: Array) -> Array:
    """Height z of the plane line on which the muscles touch.

    It sinks to the palmar side of the joint's axis.
    """
    return -1.0 - 2.5 * smoothstep(x, 34.0, 58.0)


def _flat_based(sides: int, phase: float) -> Array:
    """Outline (sides, 2) within +-1: round above, nearly flat below where the other muscle touches."""
    above, below = superellipse(sides, 2.3, phase), superellipse(sides, 4.0, phase)
    return np.where(above[:, 1:] > 0.0, above, below)


def bone_side(bones: list[Implicit]) -> PchipInterpolator:
    """y(x) just beyond the bones' radial sides, where the muscles begin."""
    x = np.arange(ORIGIN - 4.0, INSERTION + 4.0, 1.5)
    y, z = np.arange(2.0, 11.0, 0.1), np.arange(-9.0, 6.0, 0.75)
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
    distance = np.minimum(*(b(points.reshape(-1, 3)).reshape(points.shape[:3]) for b in bones))
    from_ends = np.minimum(x - ORIGIN, INSERTION - x)
    gap = (
        0.2
        + 0.4 * smoothstep(from_ends, 0.0, 8.0)
        + 0.5 * smoothstep(x, 36.0, 44.0) * (1.0 - smoothstep(x, 58.0, 66.0))
    )
    blocked = (distance < gap[:, None, None]).any(axis=2)
    reach = np.where(blocked, y, y[0]).max(axis=1)
    widened = np.maximum.reduce([np.roll(reach, shift) for shift in (-1, 0, 1)])
    widened[[0, -1]] = reach[[0, -1]]
    return PchipInterpolator(x, widened)


@dataclass(frozen=True)
class KnownMuscle:
    """A muscle in one quadrant: `side` +1 dorsal, -1 palmar of the contact; belly and tendon sizes in mm."""

    name: str
    side: float
    belly: tuple[float, float]
    tendon: tuple[float, float]
    apart: tuple[float, float]
    beside: PchipInterpolator

    def bell(self, x: Array) -> Array:
        """1 in the belly, 0 at the ends and along the tendons."""
        return smoothstep(x, ORIGIN + 1.0, 30.0) * (1.0 - smoothstep(x, 36.0, 64.0))

    def surface(self, rings: int = 72, sides: int = 36, phase: float = 0.0) -> tuple[Array, IntArray]:
        """Closed neutral surface."""
        x = np.linspace(ORIGIN, INSERTION, rings)
        bell = self.bell(x)
        width = self.tendon[0] + (self.belly[0] - self.tendon[0]) * bell
        height = self.tendon[1] + (self.belly[1] - self.tendon[1]) * bell
        near_start, near_end = 1.0 - smoothstep(x, ORIGIN, 26.0), smoothstep(x, 48.0, 68.0)
        gap = self.apart[0] * near_start + self.apart[1] * near_end
        outline = 0.5 * (_flat_based(sides, phase) + 1.0)
        y = self.beside(x)[:, None] + outline[:, 0] * width[:, None]
        v = gap[:, None] + outline[:, 1] * height[:, None]
        z = contact_height(x)[:, None] + self.side * v
        points = np.stack([np.broadcast_to(x[:, None], y.shape), y, z], axis=-1)
        if self.side < 0:
            points = points[:, ::-1]
        return close_rings(points, points[0].mean(axis=0), points[-1].mean(axis=0))

    def fractions(self, x: Array) -> dict[str, Array]:
        """For MP2, the fraction (n,) in [0, 1] of its motion that points at x (n,) in mm follow."""
        return {"MP2": ramp(x, *TRANSITION)}

    def thicken(self, points: Array, posture: Posture, growth: float) -> Array:
        """Scale sections about their corner by `thickening` plus `growth` in the belly."""
        x = points[:, 0]
        scale = self.thickening(x, posture) + growth * self.bell(x)
        corner_y, corner_z = self.beside(x), contact_height(x)
        y = corner_y + scale * (points[:, 1] - corner_y)
        return np.column_stack([x, y, corner_z + scale * (points[:, 2] - corner_z)])

    def thickening(self, x: Array, posture: Posture) -> Array:
        """Section scale (n,) at x: 1 / sqrt(stretch of the middle line), and a bulge that flexion brings."""
        line_x = np.linspace(ORIGIN, INSERTION, 200)
        middle = np.column_stack(
            [line_x, self.beside(line_x) + 0.5 * self.tendon[0], contact_height(line_x) + self.side * 1.5]
        )
        posed = posture.bend(middle, self.fractions(line_x))
        stretch = np.linalg.norm(np.diff(posed, axis=0), axis=1) / np.linalg.norm(
            np.diff(middle, axis=0), axis=1
        )
        local = np.interp(x, 0.5 * (line_x[1:] + line_x[:-1]), stretch)
        flexion = np.sin(posture.angles["MP2_flexion"]) + 0.5 * np.sin(posture.angles["MP2_abduction"])
        peak = np.exp(-(((x - 33.0) / 7.0) ** 2))
        return 1.0 + self.bell(x) * (local**-0.5 - 1.0 + 0.22 * flexion * (peak - 0.45))

    def pose(self, posture: Posture) -> tuple[Array, IntArray, float]:
        """Posed surface of exactly the neutral volume, and the growth that made it exact (secants)."""
        points, triangles = self.surface()
        target = volume(points, triangles)

        def at(growth: float) -> Array:
            return posture.bend(self.thicken(points, posture, growth), self.fractions(points[:, 0]))

        previous, growth = 0.0, 0.02
        wrong_before, wrong = (volume(at(g), triangles) - target for g in (previous, growth))
        while abs(wrong) > 1e-6 * target:
            step = wrong * (growth - previous) / (wrong - wrong_before)
            previous, wrong_before, growth = growth, wrong, growth - step
            wrong = volume(at(growth), triangles) - target
        return at(growth), triangles, growth


def muscles(bones: list[Implicit]) -> dict[str, KnownMuscle]:
    """Both muscles, beside the metacarpal and proximal phalanx given as implicit shapes."""
    beside = bone_side(bones)
    return {
        "dorsal_interosseous1": KnownMuscle(
            "dorsal_interosseous1", 1.0, (8.5, 7.5), (1.8, 2.6), (1.2, 0.4), beside
        ),
        "lumbrical1": KnownMuscle("lumbrical1", -1.0, (6.0, 5.0), (1.5, 2.0), (0.8, 0.5), beside),
    }


@dataclass(frozen=True)
class KnownLigament:
    """A flat band beside a joint, from parent to child, with radii across (y) and along (z) in mm."""

    name: str
    joint: str
    start: Array
    end: Array
    radii: tuple[float, float]
    transition: tuple[float, float]

    def surface(self, rings: int = 30, sides: int = 24, phase: float = 0.0) -> tuple[Array, IntArray]:
        """Closed neutral surface."""
        t = np.linspace(0.0, 1.0, rings)
        round_off = np.maximum(1.0 - (2.0 * t - 1.0) ** 8, 0.2) ** 0.5
        centre = self.start + t[:, None] * (self.end - self.start)
        outline = superellipse(sides, 2.5, phase) * np.array(self.radii)
        points = np.repeat(centre[:, None], sides, axis=1)
        points[..., 1:] += round_off[:, None, None] * outline
        return close_rings(points, centre[0], centre[-1])

    def pose(self, posture: Posture) -> tuple[Array, IntArray]:
        """Posed surface."""
        points, triangles = self.surface()
        fractions = {"MP2": np.ones(len(points)), self.joint: ramp(points[:, 0], *self.transition)}
        return posture.bend(points, fractions), triangles


def ligaments() -> dict[str, KnownLigament]:
    """Collateral ligaments of the PIP joint."""

    def band(name: str, side: float, y: float) -> KnownLigament:
        start, end = np.array([100.4, side * (y + 0.1), -0.4]), np.array([111.2, side * y, -1.0])
        return KnownLigament(name, "PIP2", start, end, (0.75, 1.6), (101.0, 109.5))

    return {"PIP2_radial": band("PIP2_radial", 1.0, 6.5), "PIP2_ulnar": band("PIP2_ulnar", -1.0, 6.3)}
