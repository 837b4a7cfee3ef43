"""Pose-space interpolation: weights of example poses from the rotations of a few controlling bones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

import numpy as np
from scipy.spatial.distance import pdist

from handpipe.core import Array, RigidTransform

Interpolation = Literal["inverse-distance", "inverse-square", "rbf", "exponential"]
COINCIDENT = 1e-9  # rad, or a share of the points' spread; closer poses are one
# rad, or shares of the points' spread; examples that spread less in a direction tell no slope along it.
LINEAR_SPREAD = 0.1
# Sum of absolute weights, at most: 1 to 1.6 between examples, 5 to 8 at joints' limits that no example nears.
FARTHEST = 2.0
ALIKE = (
    1.0  # rad, or a share of the points' spread: the distance over which poses become unlike by a factor of e
)


def ancestry(bone: str, parents: Mapping[str, str]) -> list[str]:
    """A bone, its parent, and so on to the root.

    Parameters
    ----------
    bone : str
        The first bone.
    parents : mapping of str to str
        Parent of each bone but the root.

    Returns
    -------
    list of str
        The bone and its ancestors.
    """
    found = [bone]
    while found[-1] in parents:
        found.append(parents[found[-1]])
    return found


def reference_bone(bones: Sequence[str], parents: Mapping[str, str]) -> str:
    """The controlling bone with most controlling descendants; the first of equals.

    Parameters
    ----------
    bones : sequence of str
        Controlling bones.
    parents : mapping of str to str
        Parent of each bone but the root.

    Returns
    -------
    str
        The reference bone.

    References
    ----------
    Zheng 2022 §4.3.
    """
    return max(bones, key=lambda a: sum(a in ancestry(b, parents)[1:] for b in bones))


def pose_vector(bones: Sequence[str], reference: str, transforms: Mapping[str, RigidTransform]) -> Array:
    """Rotation vectors of bones relative to the reference bone.

    A common motion of all bones does not change the result.

    Parameters
    ----------
    bones : sequence of str
        Controlling bones.
    reference : str
        The reference bone.
    transforms : mapping of str to RigidTransform
        Transforms from neutral by bone.

    Returns
    -------
    array (3 (len(bones) - 1),)
        Rotation vectors in rad.
    """
    undo = transforms[reference].inverse()
    return np.concatenate(
        [(undo @ transforms[b]).rotation_vector() for b in bones if b != reference] or [np.zeros(0)]
    )


def felt_vector(
    points: Mapping[str, Array], reference: str, transforms: Mapping[str, RigidTransform]
) -> Array:
    """How far points of bones move relative to the reference bone.

    The norm of the vector is the root mean square of all K points: what an organ that is attached at them
    feels of a pose. A rotation counts by its lever, which differs by an order of magnitude between the joints
    that one muscle passes. A common motion of all bones does not change the result.

    Parameters
    ----------
    points : mapping of str to array (k, 3)
        Points of each bone in neutral, mm.
    reference : str
        The reference bone.
    transforms : mapping of str to RigidTransform
        Transforms from neutral by bone.

    Returns
    -------
    array (3 K,)
        Displacements of the K points as shares of their spread.
    """
    undo = transforms[reference].inverse()
    moved = np.concatenate([(undo @ transforms[b])(p) - p for b, p in points.items()])
    rest = np.concatenate(list(points.values()))
    spread = np.linalg.norm(rest - rest.mean(axis=0))
    return moved.ravel() / spread


def _vector(
    bones: Sequence[str],
    reference: str,
    points: Mapping[str, Array],
    transforms: Mapping[str, RigidTransform],
) -> Array:
    if points:
        return felt_vector(points, reference, transforms)
    return pose_vector(bones, reference, transforms)


@dataclass(frozen=True)
class PoseSpace:
    """Example poses as pose vectors, and the weights that interpolate quantities known at the examples.

    Parameters
    ----------
    bones : tuple of str
        Controlling bones.
    reference : str
        Bone to which the motions of the others are relative.
    examples : array (N, d)
        Pose vectors of the examples: rotation vectors in rad with d = 3 (len(bones) - 1), or, with `points`,
        their relative motions (`felt_vector`).
    poses : tuple of str
        Names of the N examples.
    interpolation : str
        "inverse-distance" (Zheng 2022) is positive and has kinks at the examples. "inverse-square" is
        positive and smooth, but flat at the examples. "rbf" is linear radial basis functions with a linear
        part, which follow trends at the price of negative weights, for quantities that may be extrapolated,
        such as logarithms of strains. Far from all examples these weights are `bounded`. "exponential" is the
        best linear estimate of a quantity without mean whose correlation falls with exp(-distance / `ALIKE`):
        far from all examples it falls to zero, for corrections of what is known without them.
    points : mapping of str to array (k, 3)
        Points of each bone in neutral, in mm; empty for rotation vectors.

    Raises
    ------
    ValueError
        If the interpolation is unknown.

    References
    ----------
    Zheng 2022 §4.3, Eq. 1.
    """

    bones: tuple[str, ...]
    reference: str
    examples: Array
    poses: tuple[str, ...]
    interpolation: Interpolation = "inverse-distance"
    points: Mapping[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that the interpolation is known."""
        if self.interpolation not in get_args(Interpolation):
            raise ValueError(f"interpolation {self.interpolation!r} is none of {get_args(Interpolation)}")

    @staticmethod
    def build(
        bones: Sequence[str],
        parents: Mapping[str, str],
        transforms: Mapping[str, Mapping[str, RigidTransform]],
        interpolation: Interpolation = "inverse-distance",
        points: Mapping[str, Array] | None = None,
    ) -> PoseSpace:
        """The pose space of given example poses.

        Parameters
        ----------
        bones : sequence of str
            Controlling bones.
        parents : mapping of str to str
            Parent of each bone but the root.
        transforms : mapping of str to mapping of str to RigidTransform
            Transforms from neutral by pose and bone.
        interpolation : str
            As for `PoseSpace`.
        points : mapping of str to array (k, 3), optional
            Points of each bone in neutral, in mm, whose motions make the pose vectors; by default rotations
            do.

        Returns
        -------
        PoseSpace
            Pose space whose reference is the bone with most controlling descendants.
        """
        reference, points = reference_bone(bones, parents), dict(points or {})
        examples = np.array([_vector(bones, reference, points, t) for t in transforms.values()])
        return PoseSpace(tuple(bones), reference, examples, tuple(transforms), interpolation, points)

    def by_inverse_distance(self) -> PoseSpace:
        """The same space with the weights of Zheng 2022 Eq. 1."""
        return replace(self, interpolation="inverse-distance")

    def between(self) -> Array:
        """Distances (N, N) of the examples from one another."""
        return np.asarray(np.linalg.norm(self.examples[:, None] - self.examples[None], axis=2))

    def apart(self) -> float:
        """The distance of the two examples that are nearest to one another; infinite of a single one."""
        return float(pdist(self.examples).min(initial=np.inf))

    def vector(self, bones: Mapping[str, RigidTransform]) -> Array:
        """Pose vector (d,) of bone transforms from neutral.

        A rotation has two vectors, in opposite directions, whose lengths sum to a full turn: taken is the one
        nearer to an example. Two joints that bend by more than half a turn together would else count as bent
        backwards.
        """
        found = _vector(self.bones, self.reference, self.points, bones)
        return found if self.points else _unwound(found, self.examples)

    def weights(self, bones: Mapping[str, RigidTransform]) -> Array:
        """Weights (N,) of the examples in a pose, exact at the examples; all but "exponential" sum to one."""
        return self.weights_at(self.vector(bones))

    def weights_at(self, pose: Array) -> Array:
        """As `weights`, of a pose vector (d,)."""
        distances = np.linalg.norm(self.examples - pose, axis=1)
        here = distances < COINCIDENT
        if here.any():
            return here / here.sum()
        if self.interpolation == "rbf":
            return bounded(self._rbf_weights(pose, distances), self._near_weights(distances, 1))
        if self.interpolation == "exponential":
            return self._exponential_weights(distances)
        return self._near_weights(distances, 2 if self.interpolation == "inverse-square" else 1)

    def extrapolates(self, bones: Mapping[str, RigidTransform]) -> bool:
        """Whether a pose is so far from the examples that its weights are bounded."""
        pose = self.vector(bones)
        distances = np.linalg.norm(self.examples - pose, axis=1)
        if self.interpolation != "rbf" or (distances < COINCIDENT).any():
            return False
        return bool(np.abs(self._rbf_weights(pose, distances)).sum() > FARTHEST)

    def interpolate(self, values: Array, bones: Mapping[str, RigidTransform]) -> Array:
        """Values (...) in a pose from values (N, ...) at the examples (Zheng 2022, Eq. 2)."""
        return np.tensordot(self.weights(bones), values, axes=1)

    @staticmethod
    def _near_weights(distances: Array, power: int) -> Array:
        """Positive weights (N,) that fall with a power of the examples' distances (N,)."""
        nearness = (distances.min() / distances) ** power
        return nearness / nearness.sum()

    def _rbf_weights(self, pose: Array, distances: Array) -> Array:
        """Solve the saddle-point system of linear radial functions under reproduction of the linear part."""
        origin, directions = self._linear_part()
        n, k = len(self.examples), 1 + directions.shape[1]
        system = np.zeros((n + k, n + k))
        system[:n, :n] = self.between()
        system[:n, n] = system[n, :n] = 1
        system[:n, n + 1 :] = (self.examples - origin) @ directions
        system[n + 1 :, :n] = system[:n, n + 1 :].T
        right = np.concatenate([distances, [1.0], (pose - origin) @ directions])
        return _shared_solution(system, right)[:n]

    def _exponential_weights(self, distances: Array) -> Array:
        """The best linear estimate of what has no mean and a correlation of exp(-distance / `ALIKE`)."""
        return _shared_solution(np.exp(-self.between() / ALIKE), np.exp(-distances / ALIKE))

    def _linear_part(self) -> tuple[Array, Array]:
        """Origin (d,) and orthonormal directions (d, k) in which the examples are enough to tell a slope."""
        origin = self.examples.mean(axis=0)
        _, values, vt = np.linalg.svd(self.examples - origin, full_matrices=False)
        spread = values > LINEAR_SPREAD * np.sqrt(len(self.examples))
        # A slope in every direction that the examples span would leave nothing to the radial functions.
        few = np.arange(len(values)) < len(self.examples) - 2
        return origin, vt[spread & few].T

    def to_group(self) -> dict[str, Any]:
        """Content for an artifact's group."""
        return {
            "bones": list(self.bones),
            "reference": self.reference,
            "examples": self.examples,
            "poses": list(self.poses),
            "interpolation": self.interpolation,
            **{f"points/{bone}": points for bone, points in self.points.items()},
        }

    @staticmethod
    def from_group(group: Mapping[str, Any]) -> PoseSpace:
        """What `to_group` gave, as an artifact returned it."""
        return PoseSpace(
            tuple(group["bones"]),
            str(group["reference"]),
            np.asarray(group["examples"], float),
            tuple(group["poses"]),
            group["interpolation"],
            dict(group.get("points", {})),
        )


def _shared_solution(system: Array, right: Array) -> Array:
    """The least-norm solution: examples that coincide make a system singular, and share their weight."""
    return np.asarray(np.linalg.lstsq(system, right, rcond=1e-10)[0])


def _unwound(vector: Array, examples: Array) -> Array:
    """Rotation vectors (3 k,), each of the two that are equal taken which is nearer to an example or to none.

    examples: (N, 3 k). Vectors up to half a turn stay as they are unless an example lies beyond it.
    """
    own = vector.reshape(-1, 3)
    known = np.concatenate([np.zeros((1, *own.shape)), examples.reshape(len(examples), *own.shape)])
    angles = np.linalg.norm(own, axis=1, keepdims=True)
    other = own * (1.0 - 2.0 * np.pi / np.maximum(angles, COINCIDENT))

    def distance(to: Array) -> Array:
        return np.linalg.norm(known - to, axis=2).min(axis=0)

    return np.where((distance(other) < distance(own))[:, None], other, own).ravel()


def bounded(weights: Array, near: Array, most: float = FARTHEST) -> Array:
    """Weights that extrapolate no farther than a bound, moved towards positive weights where they do.

    Parameters
    ----------
    weights, near : array (N,)
        Weights of any sign, and positive ones; both sum to one.
    most : float
        Largest sum of absolute weights, above one.

    Returns
    -------
    array (N,)
        `weights` themselves where their absolute values sum to `most` or less; they change continuously
        beyond.
    """
    size = float(np.abs(weights).sum())
    if size <= most:
        return weights
    return near + (most - 1.0) / (size - 1.0) * (weights - near)
