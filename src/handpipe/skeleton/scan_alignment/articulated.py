"""Small rotations at the joints, by which the hand differs between scan and image."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array, RigidTransform
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.posing.skinning import blended
from handpipe.skeleton.scan_alignment.image_skin import ImageSkin, SkinHinge
from handpipe.skeleton.scan_alignment.matches import Matches
from handpipe.skeleton.scan_alignment.rigid_start import FINE, thinned

log = logging.getLogger(__name__)
ROUNDS = 30  # in which joints turn, at most
ABOUT, ASIDE = 4.0, 1.0  # deg, standard deviations of turns about a joint's axes and across them
NOISE = 0.3  # mm, of a patch's distance
PATCH = 30.0  # mm^2 of skin that count as one distance
LARGEST_STEP = 0.05  # rad
STILL = 3e-4  # rad, and mm over 100
TIGHTENING, LEAST = 0.8, 0.1  # 1 and mm: of the least deviation of a bulk, by round, down to this


@dataclass(frozen=True)
class Articulation:
    """A rigid motion of the scan, and small turns of the image's joints that meet it there.

    Parameters
    ----------
    motion : RigidTransform
        From the scan's frame into the frame of the image.
    turns : array (free joints, 3)
        Rotation vectors in rad in the frame of the image, at the joints of the skin.
    """

    motion: RigidTransform
    turns: Array = field(default_factory=lambda: np.zeros((0, 3)))

    def bones(self, skin: ImageSkin) -> list[RigidTransform]:
        """Motion of each bone from the image's pose into the scan's."""
        motions = [RigidTransform.identity()] * len(skin.bones)
        columns = {hinge.child: i for i, hinge in enumerate(skin.free)}
        for hinge in skin.hinges:
            motions[hinge.child] = motions[hinge.parent]
            if hinge.child in columns:
                turn = Rotation.from_rotvec(self.turns[columns[hinge.child]]).as_matrix()
                motions[hinge.child] = motions[hinge.parent] @ RigidTransform.about(hinge.centre, turn)
        return motions

    def blends(self, skin: ImageSkin, weights: Array) -> tuple[Rotation, Array]:
        """Rotations and translations (k, 3) of blends of the bones' motions by weights (k, bones)."""
        names = list(skin.bones)
        return blended(weights, dict(zip(names, self.bones(skin), strict=True)))

    def posed(self, skin: ImageSkin) -> Surface:
        """The image's skin in the scan's pose."""
        turns, shifts = self.blends(skin, skin.weights)
        return skin.surface.moved(turns.apply(skin.surface.vertices) + shifts)

    def angles(self, hinges: Sequence[SkinHinge]) -> dict[str, float]:
        """Angle in deg of each joint's turn, by name."""
        sizes = np.degrees(np.linalg.norm(self.turns, axis=1))
        return {hinge.name: float(size) for hinge, size in zip(hinges, sizes, strict=True)}


def articulate(scan: Surface, skin: ImageSkin, motion: RigidTransform) -> Articulation:
    """The motion and turns of least distances to tangent planes, small turns preferred (Gauss-Newton)."""
    points, normals = thinned(scan, FINE)
    found = Articulation(motion, np.zeros((len(skin.free), 3)))
    patches = max(scan.area() / PATCH, 1.0)
    least = 1.0
    for _ in range(ROUNDS):
        step = _step(points, normals, skin, found, patches, least)
        found = _moved(found, step, found.motion(points).mean(axis=0))
        least = max(TIGHTENING * least, LEAST)
        if np.abs(step[:3]).max(initial=0.0) < STILL and np.abs(step[6:]).max(initial=0.0) < STILL:
            return found
    degrees = np.degrees(np.abs(np.concatenate([step[:3], step[6:]])).max())
    log.warning("the scan still turns by %.2g deg after %d rounds of its alignment", degrees, ROUNDS)
    return found


def _step(
    points: Array, normals: Array, skin: ImageSkin, found: Articulation, patches: float, least: float
) -> Array:
    """Small motion (6,) of the scan about its middle and changes (3 free joints,) of the turns."""
    posed = found.posed(skin)
    here = found.motion(points)
    match = Matches.find(here, normals @ found.motion.rotation.T, Distance(posed), skin.trusted)
    weights = match.weights(least)
    shares = match.interpolation(posed.vertices) @ skin.joint_weights
    rows = [np.cross(here - here.mean(axis=0), match.normals), match.normals]
    bones = found.bones(skin)
    for column, hinge in enumerate(skin.free):
        arm = match.feet - bones[hinge.parent](hinge.centre)
        back = shares[:, column, None] * np.cross(arm, match.normals) @ bones[hinge.parent].rotation
        rows.append(-back)
    jacobian = np.hstack(rows)
    scale = patches / max(float(weights.sum()), 1e-9) / NOISE**2
    weighted = jacobian * (scale * weights)[:, None]
    prior = _prior(skin.free)
    matrix = weighted.T @ jacobian + 1e-9 * np.eye(jacobian.shape[1])
    matrix[6:, 6:] += prior
    right = -weighted.T @ match.signed
    right[6:] -= prior @ found.turns.reshape(-1)
    step = np.linalg.solve(matrix, right)
    largest = float(np.abs(step[6:]).max(initial=0.0))
    return step * min(1.0, LARGEST_STEP / max(largest, 1e-12))


def _prior(hinges: Sequence[SkinHinge]) -> Array:
    """Inverse covariance of the turns: small, and smaller still across a joint's axes."""
    matrix = np.zeros((3 * len(hinges), 3 * len(hinges)))
    about, aside = np.radians(ABOUT) ** -2, np.radians(ASIDE) ** -2
    for i, hinge in enumerate(hinges):
        basis = np.linalg.svd(hinge.axes, full_matrices=False)[2]
        own = basis.T @ basis
        matrix[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = about * own + aside * (np.eye(3) - own)
    return matrix


def _moved(found: Articulation, step: Array, middle: Array) -> Articulation:
    turn = RigidTransform.about(middle, Rotation.from_rotvec(step[:3]).as_matrix())
    motion = RigidTransform(np.eye(3), step[3:6]) @ turn @ found.motion
    return replace(found, motion=motion, turns=found.turns + step[6:].reshape(-1, 3))
