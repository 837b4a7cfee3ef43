"""Where a bone comes to rest on another: least energy over what of its motion is not driven."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array, ConvergenceError, RigidTransform
from handpipe.synthetic.rolling.articular import Contact
from handpipe.synthetic.rolling.bands import Bands

LEVER = 10.0  # mm at which a turn counts as a shift, so that all six coordinates are of one size
STEP = 1e-5  # mm, of the differences that give second derivatives
BALANCE = 1e-3  # mN, force (or torque over the lever) that may be left
ROUNDS = 100  # Newton steps at most
LONGEST = 0.2  # mm, longest Newton step
HALVINGS = 30  # of a step, at most
SOFTEST = 1.0  # mN/mm: a coordinate with less stiffness is treated as if it had this much


@dataclass(frozen=True)
class RollingJoint:
    """A bone on another: six coordinates, of which some are driven and the others find their equilibrium.

    The coordinates are the turns about x (distal), y (flexion) and z (abduction), of which flexion carries
    abduction and abduction the turn about the bone's own length (Grood and Suntay 1983), and shifts along the
    axes. The motion is X -> B A(y) A(z) A(x) B^T (X - C) + C + B t.

    Parameters
    ----------
    centre : array (3,)
        Point C in mm that the shifts belong to.
    frame : array (3, 3)
        Axes B in columns.
    contact : Contact
        Of the articular surfaces.
    bands : Bands
        Ligaments and tendons.
    driven : tuple of int
        Which of the three turns (0 to 2) are driven, in the order of the joint's angles.
    """

    centre: Array
    frame: Array
    contact: Contact
    bands: Bands
    driven: tuple[int, ...]

    def motion(self, coordinates: Array) -> RigidTransform:
        """The motion of the bone at coordinates (6,): three turns in rad, three shifts in mm."""
        turn = Rotation.from_euler("YZX", coordinates[[1, 2, 0]]).as_matrix()
        about = RigidTransform.about(self.centre, self.frame @ turn @ self.frame.T)
        return RigidTransform(about.rotation, about.translation + self.frame @ coordinates[3:])

    def energy(self, coordinates: Array) -> tuple[float, Array]:
        """Energy in microjoules at coordinates (6,), and its gradient (6,) in microjoules per rad and mm."""
        motion = self.motion(coordinates)
        points = motion(np.vstack([self.contact.points, self.bands.insertions]))
        count = len(self.contact.points)
        pressed, forces = self.contact.energy(points[:count])
        stretched, pulls = self.bands.energy(points[count:])
        forces = np.vstack([forces, pulls])
        torque = np.cross(points - motion(self.centre), forces).sum(axis=0)
        flexed = Rotation.from_euler("y", coordinates[1])
        along = flexed * Rotation.from_euler("z", coordinates[2])
        axes = np.array([along.apply([1.0, 0, 0]), [0, 1.0, 0], flexed.apply([0, 0, 1.0])])
        gradient = np.concatenate([axes @ (self.frame.T @ torque), self.frame.T @ forces.sum(axis=0)])
        return pressed + stretched, gradient

    def rest(self, start: Array, angles: Array) -> Array:
        """Coordinates (6,) of the equilibrium with the driven turns at the angles, from coordinates near it.

        Raises
        ------
        ConvergenceError
            If no equilibrium is found.
        """
        free = np.setdiff1d(np.arange(6), self.driven)
        scale = np.array([1 / LEVER] * 3 + [1.0] * 3)[free]
        at = start.copy()
        at[list(self.driven)] = angles

        def energy(x: Array) -> tuple[float, Array]:
            full = at.copy()
            full[free] = x * scale
            value, gradient = self.energy(full)
            return value, gradient[free] * scale

        found = at.copy()
        found[free] = minimum(energy, at[free] / scale) * scale
        return found

    def path(self, start: Array, path: Sequence[Array]) -> Array:
        """Coordinates (n, 6) of equilibria at driven angles along a path, each from the one before."""
        rows = [start]
        for angles in path:
            rows.append(self.rest(rows[-1], angles))
        return np.array(rows[1:])

    def with_tension(self, tension: Array) -> RollingJoint:
        """The joint with other tensions (n,) of its bands in mN."""
        return replace(self, bands=self.bands.with_tension(tension))


def minimum(energy: Callable[[Array], tuple[float, Array]], start: Array) -> Array:
    """Where an energy of a few coordinates (n,) in mm is least, near a start, by Newton's method.

    Second derivatives are differences of the gradient; directions of negative or no stiffness count as
    positive, so that every step goes down.

    Raises
    ------
    ConvergenceError
        If the gradient does not vanish.
    """
    x = start.copy()
    value, gradient = energy(x)
    for _ in range(ROUNDS):
        if np.abs(gradient).max() < BALANCE:
            return x
        sides = [(energy(x + e)[1] - gradient) / STEP for e in STEP * np.eye(len(x))]
        stiffness, modes = np.linalg.eigh((np.array(sides) + np.array(sides).T) / 2)
        step = -modes @ ((modes.T @ gradient) / np.maximum(np.abs(stiffness), SOFTEST))
        step *= min(1.0, LONGEST / np.linalg.norm(step))
        for _ in range(HALVINGS):
            new_value, new_gradient = energy(x + step)
            # Near the minimum the energy is at its rounding error: there the gradient has to fall.
            if new_value < value or np.linalg.norm(new_gradient) < np.linalg.norm(gradient) / 2:
                break
            step /= 2
        else:
            break
        x, value, gradient = x + step, new_value, new_gradient
    if np.abs(gradient).max() < BALANCE:
        return x
    reason = f"{np.abs(gradient).max():.3g} mN are left, the limit is {BALANCE:g} mN"
    raise ConvergenceError("a rolling joint", reason, "Check its surfaces and ligaments")
