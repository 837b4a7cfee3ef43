"""The joint angles that explain a pose's bones best, and which of them the bones do not determine.

A joint's angles are determined if the pose has both of its bones. Across a missing bone two joints share one
motion: then the search stays near the limits, and an angle that is still undetermined takes the value nearest
to neutral and is named.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from handpipe.core import Array, BoolArray, RigidTransform
from handpipe.skeleton.joints.angles import Angles
from handpipe.skeleton.joints.joint_tree import JointTree
from handpipe.skeleton.joints.joints import Model
from handpipe.skeleton.rig.displacement import displacement, displacement_rates, moments
from handpipe.skeleton.rig.twists import moving_bones

Bones = Mapping[str, RigidTransform]
AROUND = np.pi / 2  # rad from where the joint's own motion puts an angle
BEYOND = np.radians(30.0)  # beyond its limits, of an angle that no motion of its own joint determines
NOISE = 0.1  # mm, of each of the numbers that say where a bone is
UNSURE = np.radians(10.0)  # deviation of an angle that is not determined
NEUTRAL = np.radians(30.0)  # deviation from neutral that is expected of such an angle
TOLERANCES = {"xtol": 1e-14, "ftol": 1e-14, "gtol": 1e-12}
AT_BOUND = 1e-3  # rad: so near to a bound an angle is not determined
BLIND = 1e-3  # share of an angle in a direction that no bone shows


@dataclass(frozen=True)
class Explained:
    """Angles that explain registered bones.

    Parameters
    ----------
    angles : dict of str to float
        Angles of all joints in rad.
    undetermined : frozenset of str
        Angles that the bones do not determine.
    """

    angles: Angles
    undetermined: frozenset[str]


def explain(rig: JointTree, transforms: Bones, model: Model = "full") -> Explained:
    """Angles that bring the bones nearest to given transforms, with the root where it is given.

    The distance is the mean square displacement of all bones' vertices, which weighs rotations and
    translations without further parameters. Bones that are missing do not count; the root must be there.
    An angle of which no bone depends is zero.
    """
    problem = _Problem(rig, transforms, model)
    found = np.zeros(len(rig.angle_names))
    told = np.zeros(len(found), bool)
    if problem.free.any():
        found, told = problem.solve()
    names = rig.angle_names
    angles = {name: float(v) for name, v in zip(names, found, strict=True)}
    return Explained(angles, frozenset(n for n, t in zip(names, told, strict=True) if not t))


class _Problem:
    """One pose's least squares over the angles that any of its bones depends on (free)."""

    def __init__(self, rig: JointTree, transforms: Bones, model: Model) -> None:
        self.rig, self.transforms, self.model = rig, transforms, model
        self.wanted = {j.child: transforms[j.child] for j in rig.joints if j.child in transforms}
        self.of_bones = {bone: moments(rig.surfaces[bone]) for bone in self.wanted}
        carried = self._carried()
        self.free = self._by_angle({j.name: carried[j.child] for j in rig.joints})
        own = {j.name: j.child in transforms and j.parent in transforms for j in rig.joints}
        self.own = self._by_angle(own)

    def _carried(self) -> dict[str, bool]:
        """Bone -> whether it, or a bone that it carries, is in the pose."""
        found = {j.child: j.child in self.transforms for j in self.rig.joints}
        for joint in reversed(self.rig.joints):
            if joint.parent != self.rig.root:
                found[joint.parent] |= found[joint.child]
        return found

    def _by_angle(self, of_joints: Mapping[str, bool]) -> BoolArray:
        return np.array([of_joints[j.name] for j in self.rig.joints for _ in j.angles], bool)

    def solve(self) -> tuple[Array, BoolArray]:
        """Angles (n,) in rad and which of them the bones determine; from the best of all starts."""
        nothing = np.zeros(len(self.free))
        solutions = [self._minimise(start, nothing) for start in self._starts()]
        best, cost = min(solutions, key=lambda found: found[1])
        told = self._told(best, cost)
        if not told[self.free].all():
            best, _ = self._minimise(np.where(told, best, 0.0), np.where(told, 0.0, NOISE / NEUTRAL))
        return best, told

    def _minimise(self, start: Array, pull: Array) -> tuple[Array, float]:
        """Angles (n,) and half the squared residual; pull (n,) in mm per rad: towards neutral."""
        lower, upper = self._reach(start)
        free, begin = self.free, np.clip(start, lower + 1e-9, upper - 1e-9)
        pull = pull[free]

        def at(step: Array) -> Array:
            values = begin.copy()
            values[free] += step
            return values

        def residual(step: Array) -> Array:
            values = at(step)
            return np.concatenate([self._displacements(values), pull * values[free]])

        def jacobian(step: Array) -> Array:
            return np.vstack([self._rates(at(step))[:, free], np.diag(pull)])

        # Steps begin at zero: the first trust region is of the size of the start, which may be 1e-16 rad.
        bounds = (lower - begin)[free], (upper - begin)[free]
        found = least_squares(residual, np.zeros(free.sum()), jac=jacobian, bounds=bounds, **TOLERANCES)
        return at(found.x), float(found.cost)

    def _reach(self, start: Array) -> tuple[Array, Array]:
        """Lower and upper bounds (n,): about the start, or, where two joints share a motion, the limits."""
        seen = [np.vstack([np.zeros((1, j.fit.dof)), j.fit.angles, j.limits.T]) for j in self.rig.joints]
        lowest = np.concatenate([angles.min(axis=0) for angles in seen]) - BEYOND
        highest = np.concatenate([angles.max(axis=0) for angles in seen]) + BEYOND
        return np.where(self.own, start - AROUND, lowest), np.where(self.own, start + AROUND, highest)

    def _told(self, values: Array, cost: float) -> BoolArray:
        """Whether the bones determine each angle (n,): its deviation is small and it is at no bound."""
        rates = self._rates(values)[:, self.free]
        spare = max(len(rates) - rates.shape[1], 1)
        noise = max(NOISE, float(np.sqrt(2 * cost / spare)))
        deviations = noise * np.sqrt(np.diag(np.linalg.pinv(rates.T @ rates, rcond=1e-12, hermitian=True)))
        # The pseudo-inverse is blind to directions that no bone shows at all.
        values_, vectors = np.linalg.eigh(rates.T @ rates)
        blind = vectors[:, values_ < 1e-9 * max(float(values_[-1]), 1e-12)]
        lower, upper = self._reach(values)
        at_bound = ~self.own & ((values < lower + AT_BOUND) | (values > upper - AT_BOUND))
        told = np.zeros(len(values), bool)
        told[self.free] = (deviations < UNSURE) & (np.abs(blind) < BLIND).all(axis=1)
        return told & ~at_bound

    def _displacements(self, values: Array) -> Array:
        found = self.rig.bone_transforms(self._named(values), self.transforms[self.rig.root], self.model)
        return np.concatenate([displacement(found[b], t, self.of_bones[b]) for b, t in self.wanted.items()])

    def _rates(self, values: Array) -> Array:
        found = moving_bones(self.rig, self._named(values), self.transforms[self.rig.root], self.model)
        return np.vstack([displacement_rates(found[b], self.of_bones[b]) for b in self.wanted])

    def _named(self, values: Array) -> Angles:
        return dict(zip(self.rig.angle_names, values, strict=True))

    def _starts(self) -> list[Array]:
        """Angles (n,) to start from: those of the joints' own motions, zero elsewhere.

        Where two joints share a motion a wrong start bends one of them backwards: the middle and the end of
        the seen range are tried, too.
        """
        own = np.zeros(len(self.free))
        ends, i = np.zeros(len(self.free)), 0
        for joint in self.rig.joints:
            here = slice(i, i + len(joint.angles))
            i = here.stop
            ends[here] = np.vstack([np.zeros((1, joint.fit.dof)), joint.fit.angles]).max(axis=0)
            if self.own[here].any():
                relative = self.transforms[joint.parent].inverse() @ self.transforms[joint.child]
                own[here] = joint.fit.angles_of([relative])[0]
        shared = self.free & ~self.own
        levels = (0.0, 0.5, 1.0) if shared.any() else (0.0,)
        return [np.where(shared, level * ends, own) for level in levels]
