"""A hand without simulated frames: bones carry muscles that bulge, and springs carry the skin over both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from handpipe.core import Array, BoolArray, Frame, IntArray, Shape, Shapes
from handpipe.levels.joint_neighbours import bones_between, moving_bones
from handpipe.levels.mass_spring.equilibrium import MassSpring, Settled
from handpipe.levels.mass_spring.followers import Followers, duals_of
from handpipe.levels.mass_spring.geometric_muscle import Bulge, GeometricMuscle
from handpipe.levels.mass_spring.springs import Springs, forces
from handpipe.mesh.surfaces import Distance, Surface, barycentric_weights
from handpipe.mesh.tets import mass_lumped
from handpipe.skeleton.posing import bone_weights
from handpipe.skeleton.rig import Rig
from handpipe.tissues.fat import Skin

CUSHION = 1.0  # mm that are added to what lies between the skin and a bone or muscle


@dataclass(frozen=True)
class Stiffness:
    """Stiffness of the springs, with that of the skin's edges as the unit.

    Parameters
    ----------
    across : float
        Of springs across the edges, against bending.
    bones : float
        Of springs to bones on a mm^2 of skin, times the mm of tissue between.
    muscles : float
        Of springs to muscles, likewise.
    reach : float
        Farthest muscle in mm that a node has a spring to.
    rest : float
        Length of the skin's springs at rest over the neutral one: skin is under tension.
    """

    across: float = 0.25
    bones: float = 0.3
    muscles: float = 0.3
    reach: float = 8.0
    rest: float = 0.5


class AttachedSurface(Protocol):
    """A closed neutral surface in mm, and its vertices (k,) that are attached to each bone."""

    @property
    def surface(self) -> Surface:
        """Closed neutral surface, mm."""
        ...

    @property
    def attachments(self) -> Mapping[str, IntArray]:
        """Attached vertices (k,) by bone."""
        ...


class MuscleSurface(Protocol):
    """A muscle by its name and its surface: one that is fitted to scans, or a template's (`Bulging`)."""

    @property
    def name(self) -> str:
        """Name of the muscle."""
        ...

    @property
    def body(self) -> AttachedSurface:
        """Its surface."""
        ...


class Bulging(NamedTuple):
    """A muscle that no scan was fitted for.

    Parameters
    ----------
    name : str
        Name of the muscle.
    body : AttachedSurface
        Closed neutral surface in mm, and which of its vertices are attached to each bone.
    """

    name: str
    body: AttachedSurface


class Touch(NamedTuple):
    """Nodes over one muscle: their numbers (k,), corners (k, 3) and weights (k, 3) of the point below each.

    carried: the nodes as that point's bones carry them.
    """

    nodes: IntArray
    corners: IntArray
    weights: Array
    carried: Followers
    stiffness: Array


@dataclass(frozen=True, eq=False)
class SpringHand:
    """Motions of bones to muscles and skin.

    Parameters
    ----------
    surfaces : mapping of str to Surface
        Neutral bones in the order of the motions, mm.
    skin : Surface
        Neutral skin, mm; its vertices are the nodes.
    on_bones : Followers
        Nodes as the bones carry them.
    stiffness : array (n,)
        Stiffness of the springs from nodes to bones.
    muscles : tuple of GeometricMuscle
        Muscles that bulge.
    touches : tuple of Touch
        Nodes over each muscle.
    springs : MassSpring
        The skin.
    """

    surfaces: Mapping[str, Surface]
    skin: Surface
    on_bones: Followers
    stiffness: Array
    muscles: tuple[GeometricMuscle, ...]
    touches: tuple[Touch, ...]
    springs: MassSpring

    @cached_property
    def balance(self) -> Array:
        """What is added (n, 3) to the neutral nodes in mm, so that springs to it balance the tension."""
        tension = np.empty_like(self.skin.vertices)
        forces(self.skin.vertices, self.springs.springs, self.skin.vertices, self.springs.holding, tension)
        return tension / self.springs.holding[:, None]

    @cached_property
    def _pulled(self) -> tuple[Followers, tuple[Followers, ...]]:
        """Where bones, and bones below muscles, pull the nodes in neutral."""
        x = self.skin.vertices + self.balance
        return self.on_bones.at(x), tuple(t.carried.at(x[t.nodes]) for t in self.touches)

    @staticmethod
    def of(
        rig: Rig, skin: Skin, muscles: Sequence[MuscleSurface] = (), stiffness: Stiffness | None = None
    ) -> SpringHand:
        """Hand of a subject.

        Parameters
        ----------
        rig : Rig
            Joints and neutral bones.
        skin : Skin
            Neutral skin; its rigid parts lie on their bones.
        muscles : sequence of Muscle or Bulging
            Neutral muscles with attachments; without any the skin follows the bones alone.
        stiffness : Stiffness, optional
            Stiffness of the springs.

        Returns
        -------
        SpringHand
        """
        given, surfaces = stiffness or Stiffness(), {bone: rig.surfaces[bone] for bone in rig.bones}
        nodes, numbers = skin.surface.vertices, {bone: i for i, bone in enumerate(rig.bones)}
        on_bones = _on_bones(nodes, rig)
        fixed = np.zeros(len(nodes), np.bool_)
        for part in skin.with_ends(surfaces).rigid.values():
            fixed[part.vertices] = True
            on_bones.joints[part.vertices] = [numbers[part.bone], 0, 0, 0]
            on_bones.weights[part.vertices] = [1.0, 0, 0, 0]
        areas = mass_lumped(nodes, skin.surface.triangles)
        bulging = tuple(_geometric(m, rig, numbers) for m in muscles if _attached(m))
        touches = _touches(skin.surface, bulging, areas, ~fixed, given)
        below = np.min([Distance(bone).closest(nodes)[0] for bone in surfaces.values()], axis=0)
        to_bones = given.bones * areas / (below + CUSHION)
        holding = to_bones.copy()
        for touch in touches:
            holding[touch.nodes] += touch.stiffness
        springs = MassSpring(Springs.of(skin.surface, given.across, given.rest), holding, fixed)
        return SpringHand(surfaces, skin.surface, on_bones, to_bones, bulging, touches, springs)

    def posed(self, motions: Array, tolerance: float = 0.1) -> tuple[Settled, dict[str, Bulge]]:
        """Skin and muscles on bones that have moved.

        Parameters
        ----------
        motions : array (b, 3, 4)
            Motions of the bones from neutral.
        tolerance : float
            As of `MassSpring.settle`, mm.

        Returns
        -------
        skin : Settled
            Nodes in equilibrium.
        muscles : dict of str to Bulge
            Muscles by name.
        """
        duals = duals_of(motions)
        bulges = [muscle.posed(duals) for muscle in self.muscles]
        start = self.on_bones.moved(duals)
        by_bones, by_muscles = self._pulled
        pull = self.stiffness[:, None] * by_bones.moved(duals)
        for touch, carried, bulge in zip(self.touches, by_muscles, bulges, strict=True):
            shift = np.einsum("kj,kjc->kc", touch.weights, bulge.shift[touch.corners])
            pull[touch.nodes] += touch.stiffness[:, None] * (carried.moved(duals) + shift)
        targets = pull / self.springs.holding[:, None]
        targets[self.springs.fixed] = start[self.springs.fixed]
        settled = self.springs.settle(targets, start, tolerance)
        return settled, {m.name: b for m, b in zip(self.muscles, bulges, strict=True)}

    def frame(self, frame: Frame, judged: bool = True) -> dict[str, Shapes]:
        """Shapes by layer and body in a frame.

        Parameters
        ----------
        frame : Frame
            Pose.
        judged : bool
            Whether to measure `inner_overlap`, which takes longer than the frame.

        Returns
        -------
        dict of str to dict of str to Shape
            Layers "bones", "muscles" (with the figures of their `Bulge`) and "skin" (with
            `spring_residual` in mm, and `inner_overlap`, how far in mm bones and muscles are outside of it).
        """
        motions = np.array([frame.bones[bone].matrix for bone in self.surfaces])
        settled, bulges = self.posed(motions)
        bones = {
            bone: Shape(s.vertices, frame.bones[bone](s.vertices), s.triangles)
            for bone, s in self.surfaces.items()
        }
        muscles = {m.name: _shape(m.surface, bulges[m.name]) for m in self.muscles}
        figures = {"spring_residual": settled.residual}
        if judged:
            inside = np.concatenate([shape.vertices for shape in (*bones.values(), *muscles.values())])
            depths = Distance(self.skin.moved(settled.nodes), by_winding=True).signed(inside)[0]
            figures["inner_overlap"] = max(float(depths.max()), 0.0)
        skin = Shape(self.skin.vertices, settled.nodes, self.skin.triangles, figures=figures)
        return {"bones": bones, "muscles": muscles, "skin": {"skin": skin}}


def _shape(surface: Surface, bulge: Bulge) -> Shape:
    figures = {
        "stretch": bulge.stretch,
        "thickening": bulge.thickening,
        "volume_error": abs(bulge.volume_error),
    }
    return Shape(surface.vertices, bulge.vertices, surface.triangles, figures=figures)


def _attached(muscle: MuscleSurface) -> bool:
    """Whether any vertex is attached to a bone."""
    return any(len(ids) for ids in muscle.body.attachments.values())


def _geometric(muscle: MuscleSurface, rig: Rig, numbers: Mapping[str, int]) -> GeometricMuscle:
    """A muscle on the bones that it is attached to, and those between."""
    body = muscle.body
    attachments = {bone: ids for bone, ids in body.attachments.items() if len(ids)}
    bones = {bone: rig.surfaces[bone] for bone in bones_between(rig, attachments)}
    return GeometricMuscle.of(muscle.name, body.surface, attachments, bones, numbers)


def _on_bones(points: Array, rig: Rig) -> Followers:
    """Points on the bones that are near; bones that move as one count as one."""
    moving = moving_bones(rig)
    owners = np.unique(moving)
    near = bone_weights(points, {bone: rig.surfaces[bone] for bone in rig.bones})
    weights = np.stack([near[:, moving == owner].sum(axis=1) for owner in owners], axis=1)
    return Followers.of(points, weights, owners)


def _touches(
    skin: Surface, muscles: Sequence[GeometricMuscle], areas: Array, free: BoolArray, given: Stiffness
) -> tuple[Touch, ...]:
    """Springs from free nodes to the nearest muscle within reach."""
    if not muscles:
        return ()
    nodes = skin.vertices
    found = [Distance(m.surface).closest(nodes) for m in muscles]
    away = np.array([distance for distance, _, _ in found])
    nearest = away.argmin(axis=0)
    touches = []
    for number, (muscle, (distance, triangles, points)) in enumerate(zip(muscles, found, strict=True)):
        ids = np.flatnonzero((nearest == number) & (distance < given.reach) & free)
        corners = muscle.surface.triangles[triangles[ids]]
        weights = barycentric_weights(points[ids], muscle.surface.vertices[corners])
        carried = _between(muscle.followers, corners, weights, nodes[ids])
        stiffness = given.muscles * areas[ids] / (distance[ids] + CUSHION)
        touches.append(Touch(ids, corners, weights, carried, stiffness))
    return tuple(touches)


def _between(followers: Followers, corners: IntArray, weights: Array, points: Array) -> Followers:
    """Points (k, 3) on the bones of points in triangles with corners (k, 3) and weights (k, 3)."""
    bones = np.unique(followers.joints).astype(np.int64)
    every = np.stack([(followers.weights * (followers.joints == b)).sum(axis=1) for b in bones], axis=1)
    mixed = np.einsum("kj,kjb->kb", np.clip(weights, 0, 1), every[corners])
    return Followers.of(points, mixed, bones)
