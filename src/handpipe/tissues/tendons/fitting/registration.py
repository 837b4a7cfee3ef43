"""Registration of a tendon's rod to the image of a pose, in three stages (Zheng et al. 2022, sec. 5.3)."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from handpipe.core import Array, RigidTransform
from handpipe.tissues.tendons.fitting.motion import relative_to, steps_towards
from handpipe.tissues.tendons.fitting.surface_fit import SurfaceFit, TendonTarget
from handpipe.tissues.tendons.fitting.twist import untwisted
from handpipe.tissues.tendons.rods.energies import Bend, Hooks
from handpipe.tissues.tendons.rods.equilibrium import RodOptions, solve
from handpipe.tissues.tendons.rods.rest import PULL, RestTendon
from handpipe.tissues.tendons.rods.rod import closest_on_rod, tangents

log = logging.getLogger(__name__)

FindCentres = Callable[[Array, Array], tuple[Array, Array]]
SURFACE = 50.0  # c4 : c1 of Zheng 2022, Table 2


@dataclass(frozen=True)
class RegistrationSettings:
    """`smoothing` lengths in mm: wiggles of the data shorter than this are not followed."""

    largest_turn: float = 0.26  # rad of the bones between two solves of stage 1
    rigid_spacing: float = 4.0  # mm between the rigid points of stage 1
    rigid_weight: float = 0.95  # skinning weight from which a point counts as rigid to its bone
    rigid_smoothing: float = 2.0  # mm, of stage 1
    centre_rounds: int = 20  # of stage 2, at most
    centre_smoothing: float = 1.0  # mm, of stage 2
    surface_smoothing: float = 1.0  # mm, of stage 3
    surface_rounds: int = 30  # of stage 3, at most
    surface_step: float = 5e-3  # mm; stage 3 ends where no vertex moves more


@dataclass(frozen=True)
class TendonRegistration:
    """A rod in a pose, and the rods after stages 1 and 2.

    Parameters
    ----------
    x : array (Q+1, 3)
        Rod in mm.
    twist : array (Q,)
        Twist of each segment in rad.
    rough, centred : array (Q+1, 3)
        Rods in mm after stage 1, and after stage 2.
    """

    x: Array
    twist: Array
    rough: Array
    centred: Array


def rigid_hooks(
    tendon: RestTendon, bones: Mapping[str, RigidTransform], settings: RegistrationSettings
) -> Array:
    """Points (k, 3) of the rod that move rigidly with their bone, carried to a pose.

    On the inner side of a bent joint the courses on its two bones cross: the tendon changes from one to the
    other where they come closest, and points beyond are left out.
    """
    owner = np.argmax(tendon.skinning, axis=1)
    kept = tendon.skinning.max(axis=1) > settings.rigid_weight
    points = np.stack([bones[name](tendon.x) for name in tendon.bones])[owner, np.arange(len(owner))]
    for n in range(len(tendon.bones) - 1):
        before, after = np.flatnonzero(kept & (owner == n)), np.flatnonzero(kept & (owner == n + 1))
        if len(before) == 0 or len(after) == 0:
            continue
        apart = cdist(points[before], points[after])
        i, j = np.unravel_index(np.argmin(apart), apart.shape)
        kept[before[i + 1 :]] = False
        kept[after[:j]] = False
    every = max(int(round(settings.rigid_spacing / tendon.length)), 1)
    kept &= np.arange(len(owner)) % every == every // 2
    return points[kept]


def follow_bones(
    tendon: RestTendon, bones: Mapping[str, RigidTransform], settings: RegistrationSettings
) -> Array:
    """Stage 1: rigid points as hooks, bones moved slowly from neutral. Returns x (Q+1, 3)."""
    x, base = tendon.x, tendon.bones[-1]
    bend = Bend(PULL * settings.rigid_smoothing**2, tendon.length)
    for pose in steps_towards(relative_to(bones, base), tendon.bones, settings.largest_turn):
        hooks = Hooks(rigid_hooks(tendon, pose, settings))
        start = x + (pose[tendon.bones[0]](tendon.x[:1])[0] - x[0])
        x = solve([hooks, tendon.pull(pose), bend], start).x
    return bones[base](x)


def _centre_hooks(x: Array, find_centres: FindCentres) -> Hooks:
    """The image's centres at the vertices' planes as hooks, with their confidences as weights."""
    centres, confidence = find_centres(x, tangents(x))
    used = np.isfinite(centres).all(axis=1) & (confidence > 0)
    used[0] = False  # the first vertex is fixed
    return Hooks(centres[used], confidence[used])


def follow_centres(
    tendon: RestTendon,
    bones: Mapping[str, RigidTransform],
    x: Array,
    find_centres: FindCentres,
    settings: RegistrationSettings,
) -> Array:
    """Stage 2: the image's dark centres in planes across the curve as hooks, found again in each round."""
    for _ in range(settings.centre_rounds):
        hooks = _centre_hooks(x, find_centres)
        if len(hooks.points) == 0:
            log.warning("stage 2: no centre of the tendon was found in the image")
            return x
        stiffness = 2.0 * float(np.mean(hooks.weights)) / tendon.length
        bend = Bend(stiffness * settings.centre_smoothing**4, tendon.length)
        moved = solve([hooks, tendon.pull(bones), bend], x).x
        change = float(np.abs(moved - x).max())
        x = moved
        if change < settings.surface_step:
            break
    return x


def fit_surface(
    tendon: RestTendon,
    bones: Mapping[str, RigidTransform],
    x: Array,
    target: TendonTarget,
    settings: RegistrationSettings,
    centres: Hooks | None = None,
) -> tuple[Array, Array]:
    """Stage 3: point-to-plane ICP of the skinned tube. Returns x (Q+1, 3) and twist (Q,).

    `centres`, hooks of stage 2, are kept with the surface's stiffness: where the surface is not trusted,
    and at the free end, they hold the rod better than its bending.
    """
    stiffness = SURFACE * PULL
    bend = Bend(stiffness * settings.surface_smoothing**4, tendon.length)
    first, twist = tendon.first_normal(bones), np.zeros(len(x) - 1)
    fit = SurfaceFit(tendon.tube, target, first, stiffness, tendon.length, twist)
    hooks = [] if centres is None else [Hooks(centres.points, stiffness * centres.weights)]
    once = RodOptions(max_iterations=1, accept_unfinished=True)
    for n in range(settings.surface_rounds):
        moved = solve([fit, tendon.pull(bones), bend, *hooks], x, once).x
        twist = untwisted(twist, 1.0, fit, moved)
        fit.twist = twist
        change = float(np.abs(moved - x).max())
        x = moved
        log.debug("stage 3: round %d, largest motion %.4f mm", n, change)
        if change < settings.surface_step:
            break
    return x, twist


def register(
    tendon: RestTendon,
    bones: Mapping[str, RigidTransform],
    find_centres: FindCentres,
    target: Callable[[Array], TendonTarget | None] | None = None,
    settings: RegistrationSettings | None = None,
) -> TendonRegistration:
    """The rod in an example pose, with the rest rod's segment lengths and its first vertex on its bone.

    Parameters
    ----------
    tendon : RestTendon
        The tendon at rest.
    bones : mapping of str to RigidTransform
        Bone transforms from neutral.
    find_centres : callable
        `find_centres(points, tangents)` gives the image's centres (n, 3) in mm and confidences (n,) in the
        planes across a curve.
    target : callable, optional
        `target(x)` gives the tendon's surface in the image around the rod of stage 2, or None where it cannot
        be extracted. Without a surface the rod of stage 2 is the result.
    settings : RegistrationSettings, optional
        Lengths and limits of the stages.

    Returns
    -------
    TendonRegistration
        Rod in mm, twist in rad, and the rods of stages 1 and 2.

    Raises
    ------
    ConvergenceError
        Where a stage finds no equilibrium.
    """
    settings = settings or RegistrationSettings()
    rough = follow_bones(tendon, bones, settings)
    centred = follow_centres(tendon, bones, rough, find_centres, settings)
    surface = target(centred) if target is not None else None
    if surface is None:
        return TendonRegistration(centred, np.zeros(len(centred) - 1), rough, centred)
    centres = _centre_hooks(centred, find_centres)
    x, twist = fit_surface(tendon, bones, centred, surface, settings, centres)
    return TendonRegistration(x, twist, rough, centred)


def centreline_errors(x: Array, truth: Array) -> tuple[Array, Array]:
    """Distances between a rod and a true centreline, both ways.

    Points beyond the other curve's ends are left out: where a centreline is cut off is arbitrary.

    Parameters
    ----------
    x : array (Q+1, 3)
        Rod in mm.
    truth : array (n, 3)
        True centreline in mm.

    Returns
    -------
    to_rod : array (k,)
        Distances in mm from points of the true centreline to the rod.
    to_truth : array (l,)
        Distances in mm from vertices of the rod to the true centreline.
    """

    def within(points: Array, curve: Array) -> Array:
        segment, t, distance = closest_on_rod(points, curve)
        past = ((segment == 0) & (t == 0.0)) | ((segment == len(curve) - 2) & (t == 1.0))
        return distance[~past]

    return within(truth, x), within(x, truth)
