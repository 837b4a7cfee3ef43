"""A template brought near to a person's feature points by its joints: each bone turned, and sized as a whole.

Feature points lie almost in one plane. They show neither how thick a hand is nor which way a bone faces. An
interpolation would guess both from the poses of the two hands; the joints determine them.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from handpipe.anatomy.person.bony_points import away_from
from handpipe.anatomy.person.feature_points import FINGERS, Points
from handpipe.anatomy.person.subject_template import SubjectTemplate, TemplateJoint
from handpipe.core import Array
from handpipe.mesh.surfaces import Biharmonic
from handpipe.tissues.muscles.fitting import Affine, fit_similarity

log = logging.getLogger(__name__)

# Standard deviations of how persons differ: of a feature point on its bone in mm, of an angle in rad, and of
# the logarithms of the rays' size against the carpus's (whose height is 0.54 +- 0.03 of metacarpal III:
# Youm et al. 1978) and of a bone's length against its rays'. Held-out landmarks hardly depend on the others.
POINT, ANGLE, RAYS, LENGTH = 2.0, np.radians(25.0), 0.056, 0.05  # mm, rad, 1 and 1: as said above
OF_RAYS = ("metacarpal", "proximal", "middle", "distal")
SAMPLES = 40  # points a bone that carry its motion into the space around it
SMOOTHING = 0.5  # of the warp between the samples


@dataclass(frozen=True, eq=False)
class Segment:
    """A joint's child, and the unit axis (3,) away from the joint along which it is sized."""

    joint: TemplateJoint
    axis: Array


class Skeleton:
    """The template's bones as segments, parents first, and how they move and grow."""

    def __init__(self, template: SubjectTemplate) -> None:
        self.template = template
        self.root = template.root
        children = {joint.child: joint for joint in template.joints}
        self.segments = [
            Segment(joint, away_from(template.bones[joint.child], joint.centre)) for joint in template.joints
        ]
        self.with_root = tuple(b for b in template.bones if b not in children)
        self.bases = {
            joint.parent: self._base(joint)
            for joint in template.joints
            if joint.parent in self.with_root and joint.parent.startswith(OF_RAYS)
        }

    def maps(
        self,
        root: Affine,
        angles: Mapping[str, float] | None = None,
        lengths: Mapping[str, float] | None = None,
        rays: float = 1.0,
    ) -> dict[str, Affine]:
        """The map of each bone from the template to a pose.

        Parameters
        ----------
        root : Affine
            The root's similarity.
        angles : mapping of str to float
            Angles of the joints in rad, about their centres; zero where absent.
        lengths : mapping of str to float
            Each bone's ratio of length to its size across, relative to the template's; one where absent.
        rays : float
            Size of the bones of the rays relative to the root's scale. Bones of the rays that no joint
            carries grow from their end at the carpus.
        """
        angles, lengths = angles or {}, lengths or {}
        scale = float(np.cbrt(np.linalg.det(root.matrix)))
        turns: dict[str, Array] = {}
        found: dict[str, Affine] = {}

        def grown(bone: str, axis: Array, base: Array, to: Array) -> Affine:
            size = scale * rays if bone.startswith(OF_RAYS) else scale
            stretch = size * (np.eye(3) + (lengths.get(bone, 1.0) - 1.0) * np.outer(axis, axis))
            return Affine(turns[bone] @ stretch, to - turns[bone] @ stretch @ base)

        for bone in self.with_root:
            found[bone], turns[bone] = root, root.matrix / scale
            if bone in self.bases:
                base, axis = self.bases[bone]
                found[bone] = grown(bone, axis, base, root(base[None])[0])
        for segment in self.segments:
            joint, turn = segment.joint, np.eye(3)
            for name, axis in zip(joint.angles, joint.axes, strict=True):
                turn = Rotation.from_rotvec(angles.get(name, 0.0) * axis).as_matrix() @ turn
            turns[joint.child] = turns[joint.parent] @ turn
            to = found[joint.parent](joint.centre[None])[0]
            found[joint.child] = grown(joint.child, segment.axis, joint.centre, to)
        for bone, other in self.template.moves_with.items():
            found[bone] = found[other]
        return found

    def _base(self, joint: TemplateJoint) -> tuple[Array, Array]:
        """The end (3,) of a joint's parent away from it, and the parent's unit axis (3,) from there."""
        bone = self.template.bones[joint.parent]
        axis, middle = -away_from(bone, joint.centre), bone.vertices.mean(axis=0)
        return middle + ((bone.vertices - middle) @ axis).min() * axis, axis

    def owner(self, point: str) -> str | None:
        """The bone under a feature point; none for the skin between fingers."""
        joints = {joint.name: joint for joint in self.template.joints}
        if point in joints:
            return joints[point].parent
        if point.startswith("tip"):
            last = joints.get(f"DIP{point[-1]}" if int(point[-1]) in FINGERS else "IP1")
            return None if last is None else last.child
        if point.startswith(("wrist", "ulna")):
            return joints["wrist"].child if "wrist" in joints else self.root
        return None

    def moved_points(self, maps: Mapping[str, Affine]) -> dict[str, Array]:
        """The template's feature points (3,) in mm on bones that have moved (`carrier`)."""
        return {n: self.carrier(n, maps)(p) for n, p in self.template.feature_points.items()}

    def carrier(self, point: str, maps: Mapping[str, Affine]) -> Affine:
        """The map of a feature point: of its bone; of the skin between two rays, the mean of their bones'."""
        owner = self.owner(point)
        if owner in self.template.bones:
            return maps[str(owner)]
        beside = [f"{kind}{ray}" for ray in point[-2:] for kind in OF_RAYS[:2]]
        near = [maps[bone] for bone in beside if bone in maps] or [maps[self.root]]
        matrix, offset = (np.mean([getattr(m, part) for m in near], axis=0) for part in ("matrix", "offset"))
        return Affine(matrix, offset)

    def field(
        self, maps: Mapping[str, Affine], samples: int = SAMPLES, smoothing: float = SMOOTHING
    ) -> Biharmonic:
        """The bones' maps carried on into the space around them."""
        source, target = [], []
        for name, surface in self.template.bones.items():
            points = farthest_points(surface.vertices, samples)
            source.append(points)
            target.append(maps[name](points))
        return Biharmonic(np.vstack(source), np.vstack(target), smoothing)


def farthest_points(points: Array, count: int) -> Array:
    """Some of points (n, 3), each as far as can be from those before it; the first from their middle."""
    chosen = [int(np.argmax(((points - points.mean(axis=0)) ** 2).sum(axis=1)))]
    distance = np.full(len(points), np.inf)
    for _ in range(min(count, len(points)) - 1):
        distance = np.minimum(distance, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(np.argmax(distance)))
    return points[chosen]


@dataclass(frozen=True, eq=False)
class PosedHand:
    """A template's bones in the pose and sizes of a person.

    Parameters
    ----------
    skeleton : Skeleton
        The template's bones.
    root : Affine
        The root's similarity.
    angles : dict of str to float
        Angles in rad from the template's pose.
    lengths : dict of str to float
        Each bone's ratio of length to its size across, relative to the template's.
    rays : float
        Size of the bones of the rays relative to the root's scale.
    misfit : float
        Sum of squares that the most probable pose leaves.
    """

    skeleton: Skeleton
    root: Affine
    angles: dict[str, float]
    lengths: dict[str, float]
    rays: float
    misfit: float = 0.0

    def maps(self) -> dict[str, Affine]:
        """The map of each bone from the template to the person's pose."""
        return self.skeleton.maps(self.root, self.angles, self.lengths, self.rays)

    def maps_at_rest(self) -> dict[str, Affine]:
        """The map of each bone to its size alone, in the template's own pose and place."""
        scale = float(np.cbrt(np.linalg.det(self.root.matrix)))
        return self.skeleton.maps(Affine(scale * np.eye(3), np.zeros(3)), {}, self.lengths, self.rays)


def posed(template: SubjectTemplate, target: Points) -> Biharmonic:
    """The map that poses the template as the target feature points show, and sizes its bones (`fit_pose`)."""
    found = fit_pose(template, target)
    return found.skeleton.field(found.maps())


def fit_pose(template: SubjectTemplate, target: Points, pose: Mapping[str, float] | None = None) -> PosedHand:
    """Pose and sizes of the template's bones as target feature points show them.

    The most probable similarity of the hand, angles, size of the rays and lengths of their bones: squares of
    distances, of angles from the expected ones and of differences in size and length weigh by `POINT`,
    `ANGLE`, `RAYS` and `LENGTH`. No point lies between knuckles and wrist: the correlation of long fingers
    with long metacarpals determines where the carpus ends.

    Parameters
    ----------
    template : SubjectTemplate
        Template with feature points.
    target : mapping of str to array (3,)
        The person's feature points in mm by name.
    pose : mapping of str to float, optional
        Expected angles in rad; zero, the template's own pose, where absent.

    Returns
    -------
    PosedHand
        The bones in that pose.
    """
    skeleton, expected = Skeleton(template), pose or {}
    before = skeleton.moved_points(skeleton.maps(Affine(np.eye(3), np.zeros(3)), expected))
    source = template.feature_points
    names = [n for n in source if n in target and skeleton.owner(n) in template.bones]
    owners = [str(skeleton.owner(n)) for n in names]
    both = [n for n in source if n in target]
    start = fit_similarity(np.array([before[n] for n in both]), np.array([target[n] for n in both]))
    scale = float(np.cbrt(np.linalg.det(start.matrix)))
    turn = Rotation.from_matrix(start.matrix / scale).as_rotvec()
    angles = [a for joint in template.joints for a in joint.angles]
    sized = [*(joint.child for joint in template.joints), *skeleton.bases]
    deviations = [RAYS] + [ANGLE] * len(angles) + [LENGTH] * len(sized)
    usual = np.array([0.0, *(expected.get(a, 0.0) for a in angles), *([0.0] * len(sized))])

    def hand(x: Array) -> PosedHand:
        root = Affine(np.exp(x[6]) * Rotation.from_rotvec(x[:3]).as_matrix(), x[3:6])
        given = dict(zip(angles, x[8:], strict=False))
        ratios = dict(zip(sized, np.exp(x[8 + len(angles) :]), strict=True))
        return PosedHand(skeleton, root, given, ratios, float(np.exp(x[7])))

    def residuals(x: Array) -> Array:
        found = hand(x).maps()
        away = [found[bone](source[n][None])[0] - target[n] for n, bone in zip(names, owners, strict=True)]
        return np.concatenate([np.ravel(away) / POINT / scale, (x[7:] - usual) / deviations])

    first = np.concatenate([turn, start.offset, [np.log(scale)], usual])
    fit = least_squares(residuals, first, x_scale="jac", method="trf", xtol=1e-8, ftol=1e-8)
    if not fit.success:
        log.warning("the pose was not fitted to the end: %s", fit.message)
    best = fit.x
    rest = np.linalg.norm(residuals(best)[: 3 * len(names)].reshape(-1, 3), axis=1) * POINT * scale
    log.info(
        "posed by %d feature points: mean distance %.1f mm, largest %.1f mm",
        len(names),
        rest.mean(),
        rest.max(),
    )
    return replace(hand(best), misfit=float((residuals(best) ** 2).sum()))
