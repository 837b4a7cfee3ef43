"""One joint of the bone rig: axes, centre and residual motion fitted to registered poses (Wang 2019, section 4)."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handpipe.mesh.rigid import RigidTransform
from handpipe.skeleton.axes import best_angles, fit_axes, rotation_about
from handpipe.skeleton.residual import SHRINKAGE, TERMS, Residual, Terms, fit_residual

Array = NDArray[np.float64]
Model = Literal["full", "partial"]
Errors = tuple[Array, Array]
LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class JointFit:
    """X -> R^(phi) R(phi) (X - C) + C + x^(phi) (Wang 2019, Eq. 2), in the neutral frame with the parent at rest.

    axes (dof, 3), orthogonal; centre C (3,) in mm; rotation_residual gives the rotation vector of R^ in rad,
    translation_residual x^ in mm; angles (n, dof) in rad: the fitted angles of the poses it was fitted to.
    """

    axes: Array
    centre: Array
    rotation_residual: Residual
    translation_residual: Residual
    angles: Array

    @property
    def dof(self) -> int:
        return len(self.axes)

    def transform(self, angles: Array, model: Model = "full") -> RigidTransform:
        """Motion of the child relative to the parent at angles (dof,) in rad; "partial" leaves the residuals out."""
        about = RigidTransform.about(self.centre, rotation_about(self.axes, angles))
        if model == "partial":
            return about
        small = Rotation.from_rotvec(self.rotation_residual(angles)[0]).as_matrix()
        return RigidTransform(np.eye(3), self.translation_residual(angles)[0]) @ (
            RigidTransform.about(self.centre, small) @ about
        )

    def angles_of(self, relative: Sequence[RigidTransform]) -> Array:
        """Angles (n, dof) in rad whose rotations about the axes are nearest to the given motions (Eq. 1, Eq. 4)."""
        return best_angles(self.axes, np.array([t.rotation for t in relative]))

    def errors(self, relative: Sequence[RigidTransform], point: Array, model: Model = "full") -> Errors:
        """Rotation errors (n,) in rad, and errors (n,) in mm of a point (3,) of the neutral child."""
        found = [self.transform(a, model) for a in self.angles_of(relative)]
        rotation = [f.angle_to(t) for f, t in zip(found, relative, strict=True)]
        shift = [np.linalg.norm(f(point) - t(point)) for f, t in zip(found, relative, strict=True)]
        return np.array(rotation), np.array(shift)


@dataclass(frozen=True)
class _Core:
    """Axes and centre, the residual motions that they leave, and a way to tell them for another pose."""

    axes: Array
    centre: Array
    angles: Array
    rotation: Array
    translation: Array

    def residuals_of(self, relative: Sequence[RigidTransform]) -> tuple[Array, Array, Array]:
        return _residuals(self.axes, self.centre, relative)


def fit_joint(
    relative: Sequence[RigidTransform], dof: int, axis_hints: Array, *, near: Array | None = None
) -> JointFit:
    """Fit a joint to motions of the child relative to the parent, from neutral, in the neutral frame.

    dof: 1 or 2. axis_hints (dof, 3): rough axes that fix the signs. near (3,): a point near the joint; it fixes
    the centre where the motions leave it undetermined, along the axis of a one-axis joint. The terms and the
    shrinkage of each residual function are those that predict left-out poses best. Neutral need not be among
    `relative`: it is the zero of every function.
    """
    hints = np.asarray(axis_hints, float)
    near = np.zeros(3) if near is None else near
    core = _fit_core(relative, hints, near, dof)
    held = [(_fit_core(rest, hints, near, dof), [left]) for rest, left in leave_one_out(relative)]
    rotation_choice = _choose(held, lambda c: (c.angles, c.rotation), 1, dof)
    translation_choice = _choose(held, lambda c: (c.angles, c.translation), 2, dof)
    LOG.debug("rotation residual %s, translation residual %s", rotation_choice, translation_choice)
    return JointFit(
        core.axes,
        core.centre,
        fit_residual(core.angles, core.rotation, *rotation_choice),
        fit_residual(core.angles, core.translation, *translation_choice),
        core.angles,
    )


def leave_one_out(
    relative: Sequence[RigidTransform],
) -> Iterator[tuple[list[RigidTransform], RigidTransform]]:
    """Every split into one motion and the rest; none where the rest would be empty."""
    if len(relative) > 1:
        for i, left in enumerate(relative):
            yield [t for j, t in enumerate(relative) if j != i], left


def fit_centre(relative: Sequence[RigidTransform], dof: int, near: Array) -> Array:
    """Centre C (3,) that minimises sum |x_i + (R_i - I) C|^2 (Wang 2019, Eq. 3).

    A one-axis joint leaves C free along its axis, and a two-axis joint whose second axis hardly moved nearly so:
    there C stays at `near`.
    """
    a = np.concatenate([t.rotation - np.eye(3) for t in relative])
    b = np.concatenate([t(near) - near for t in relative])
    _, values, vt = np.linalg.svd(a, full_matrices=False)
    # Directions moved by less than about two degrees a pose carry no more than the noise of registration.
    keep = (values > 0.035 * np.sqrt(len(relative))) & (np.arange(3) < dof + 1)
    directions = vt[keep].T
    return near - directions @ np.linalg.lstsq(a @ directions, b, rcond=None)[0]


def _fit_core(relative: Sequence[RigidTransform], hints: Array, near: Array, dof: int) -> _Core:
    axes = fit_axes(np.array([t.rotation for t in relative]), hints)
    centre = fit_centre(relative, dof, near)
    return _Core(axes, centre, *_residuals(axes, centre, relative))


def _residuals(axes: Array, centre: Array, relative: Sequence[RigidTransform]) -> tuple[Array, Array, Array]:
    """Angles (n, dof), rotation vectors of R_i R(phi_i)^T (n, 3), and x_i + (R_i - I) C (n, 3)."""
    rotations = np.array([t.rotation for t in relative])
    angles = best_angles(axes, rotations)
    small = [r @ rotation_about(axes, a).T for r, a in zip(rotations, angles, strict=True)]
    translation = np.array([t(centre) - centre for t in relative])
    return angles, Rotation.from_matrix(np.array(small)).as_rotvec(), translation


def _choose(
    held: list[tuple[_Core, list[RigidTransform]]],
    samples: Callable[[_Core], tuple[Array, Array]],
    which: int,
    dof: int,
) -> tuple[Terms, float]:
    """Terms and shrinkage of least mean error on left-out poses; the simplest of equals."""
    best: tuple[Terms, float] = ((), 0.0)
    least = np.inf
    for terms in TERMS[dof]:
        for shrinkage in SHRINKAGE if terms else (0.0,):
            errors = []
            for core, left in held:
                truth = core.residuals_of(left)
                predicted = fit_residual(*samples(core), terms, shrinkage)(truth[0])
                errors.append(np.linalg.norm(predicted - truth[which]))
            mean = float(np.mean(errors)) if errors else 0.0
            if mean < least - 1e-9:
                best, least = (terms, shrinkage), mean
    return best
