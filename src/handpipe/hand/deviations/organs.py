"""What is stated of tendons, muscles and skin, learned from their example poses without any truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from handpipe.core import Array, RigidTransform
from handpipe.hand.deviations.body import BodyDeviation, around, left_out_scale
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.posing import bone_weights
from handpipe.tissues.fat import FatStrains, Tissue
from handpipe.tissues.muscles import Muscle
from handpipe.tissues.tendons import Tendon

HIDDEN = 0.5  # of the error of a muscle's template that is left where the image shows no boundary
SAME = 1e-9  # mm between places along a rod, so that none is the same as another
RIM = 1.0  # mm from the rim of an open surface, within which a closest point may stand for one beyond it
FAR = 3.0  # mm: what was seen of an organ and is farther away shows another part of it, or nothing
Bones = Mapping[str, RigidTransform]


@dataclass(frozen=True)
class Seen:
    """An organ in an example pose: as simulated, and as it was seen there, both with the root at rest.

    Parameters
    ----------
    simulated : array (n, 3)
        Points of the body in mm.
    seen : Surface
        A surface in mm; of a tendon its centreline, of segments as triangles without area.
    rim : array (k, 3)
        Points of an open surface's rim in mm; none of a closed one.
    """

    simulated: Array
    seen: Surface
    rim: Array = field(default_factory=lambda: np.zeros((0, 3)))


def fit_variances(examples: Mapping[str, Seen], rest: Array) -> dict[str, Array]:
    """Squares (n,) in mm^2 by pose of the distances of simulated points from what was seen there.

    rest: (n, 3) places of the points, to take means over neighbours.
    """
    return {pose: around(_squares(example), rest) for pose, example in examples.items()}


def _squares(example: Seen) -> Array:
    """Squared distances (n,) in mm^2; past the rim of what was seen the mean of the others."""
    distances, _, closest = Distance(example.seen).closest(example.simulated)
    squares, known = np.minimum(distances, FAR) ** 2, np.ones(len(distances), dtype=bool)
    if len(example.rim):
        known = cKDTree(example.rim).query(closest)[0] > RIM
    return np.where(known, squares, squares[known].mean() if known.any() else FAR**2)


def of_tendon(tendon: Tendon, fits: Mapping[str, Seen], surfaces: Mapping[str, Surface]) -> BodyDeviation:
    """Of a tendon's centreline: hooks are corrected over poses, and the rod runs through them.

    Parameters
    ----------
    tendon : Tendon
        The tendon.
    fits : mapping of str to Seen
        Its rods in the example poses.
    surfaces : mapping of str to Surface
        Neutral bones, mm.

    Returns
    -------
    BodyDeviation
        What is stated of the rod's nodes.
    """
    rest, hooks = tendon.rest.x, tendon.hooks
    order = np.argsort(_along(hooks.rest, rest))
    places, corrections = hooks.rest[order], hooks.corrections[:, order]
    own = {bone: surfaces[bone] for bone in tendon.spaces.spaces}
    spaces = list(tendon.spaces.spaces.values())
    scale = left_out_scale(spaces, bone_weights(places, own), corrections, places)
    spread = np.interp(_along(rest, rest), _along(places, rest), scale)
    carried, shares = bone_weights(rest, surfaces), bone_weights(rest, own)
    found, nothing = fit_variances(fits, rest), np.zeros(len(rest))
    return BodyDeviation("tendons", tendon.spaces.spaces, shares, spread, found, carried, nothing)


def _along(points: Array, rod: Array) -> Array:
    """Arc length (n,) in mm of the rod's nodes that are nearest to points (n, 3)."""
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rod, axis=0), axis=1))])
    nearest = np.linalg.norm(points[:, None] - rod[None], axis=2).argmin(axis=1)
    return np.asarray(arc[nearest] + SAME * np.arange(len(points)))


def of_muscle(
    muscle: Muscle, template: Surface, fits: Mapping[str, Seen], surfaces: Mapping[str, Surface]
) -> BodyDeviation:
    """Of a muscle's surface: how far beside the flesh's motion it lies is interpolated over poses.

    Where no flesh is known, how far it lies off the motion of the pose space's reference bone.

    Parameters
    ----------
    muscle : Muscle
        The muscle.
    template : Surface
        Its template as the bones place it in neutral, mm. Where the image shows the boundary, the fit
        tells how wrong the template is; elsewhere a share of that error is left.
    fits : mapping of str to Seen
        Its surfaces in the example poses.
    surfaces : mapping of str to Surface
        Neutral bones, mm.

    Returns
    -------
    BodyDeviation
        What is stated of the surface's vertices.
    """
    body, space = muscle.body, muscle.space
    surface = body.surface
    if muscle.bed is not None:
        beside = muscle.bed.beside
    else:
        back = [bones[space.reference].inverse() for bones in muscle.bones]
        beside = np.stack([t(x) for t, x in zip(back, muscle.vertices, strict=True)]) - body.mesh.vertices
    normal = surface.vertex_normals()
    corrections = np.stack([((body.matrix @ x) * normal).sum(axis=1) for x in beside])[..., None]
    shares = np.ones((len(surface.vertices), 1))
    scale = left_out_scale([space], shares, corrections, surface.vertices)
    carried = bone_weights(surface.vertices, surfaces)
    found = fit_variances(fits, surface.vertices)
    hidden = _hidden(muscle, template)
    return BodyDeviation("muscles", {muscle.name: space}, shares, scale, found, carried, hidden)


def _hidden(muscle: Muscle, template: Surface) -> Array:
    """Mean squares (n,) in mm^2 of what the image does not show of a muscle in neutral."""
    body = muscle.body
    unseen = ~body.visible
    unseen[body.attached_vertices] = False
    moved = Distance(template).closest(body.surface.vertices)[0][body.visible]
    wrong = float(np.mean(moved**2)) if len(moved) else 0.0
    return around(np.where(unseen, HIDDEN**2 * wrong, 0.0), body.surface.vertices)


@dataclass(frozen=True)
class ExampleTissue:
    """The fat in an example pose.

    Parameters
    ----------
    bones : mapping of str to RigidTransform
        Bone transforms of the pose from neutral.
    strained, unstrained : array (n, 3)
        The fat's vertices with its plastic strains and without them, mm.
    """

    bones: Bones
    strained: Array
    unstrained: Array


def of_skin(
    tissue: Tissue,
    strains: FatStrains,
    examples: Sequence[ExampleTissue],
    fits: Mapping[str, Seen],
    bones: Sequence[str],
) -> BodyDeviation:
    """Of the skin: its plastic strains move it along its normals, more in one pose than in another.

    Parameters
    ----------
    tissue : Tissue
        The fat.
    strains : FatStrains
        Its strains over poses.
    examples : sequence of ExampleTissue
        The fat in the example poses, in the order of the strains, without neutral.
    fits : mapping of str to Seen
        The skin in the example poses.
    bones : sequence of str
        Bones of the hand in their order.

    Returns
    -------
    BodyDeviation
        What is stated of the skin's vertices.
    """
    skin, matrix = tissue.skin, tissue.skin_matrix
    moved = [
        matrix @ (tissue.shifts(e.bones, e.strained) - tissue.shifts(e.bones, e.unstrained)) for e in examples
    ]
    normal = skin.vertex_normals()
    corrections = np.stack([np.zeros(len(normal)), *((m * normal).sum(axis=1) for m in moved)])[..., None]
    shares = np.maximum(matrix @ tissue.weights, 0.0)
    shares /= shares.sum(axis=1, keepdims=True)
    spaces = {bone: strains.spaces.spaces[bone] for bone in tissue.bones}
    scale = left_out_scale(list(spaces.values()), shares, corrections, skin.vertices)
    carried = np.zeros((len(normal), len(bones)))
    carried[:, [list(bones).index(bone) for bone in tissue.bones]] = shares
    found, nothing = fit_variances(fits, skin.vertices), np.zeros(len(normal))
    return BodyDeviation("skin", spaces, shares, scale, found, carried, nothing)


def centreline(points: Array) -> Surface:
    """A curve as a surface without area, for distances from it.

    Parameters
    ----------
    points : array (n, 3)
        Points along the curve, mm.

    Returns
    -------
    Surface
        Its segments as triangles with two equal corners.
    """
    first = np.arange(len(points) - 1)
    return Surface(points, np.column_stack([first, first + 1, first + 1]))
