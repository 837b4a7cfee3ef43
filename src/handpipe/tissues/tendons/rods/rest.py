"""A tendon at rest: its rod and tube in neutral, and how bones carry them to where a solve starts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from handpipe.core import Array, RigidTransform
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.posing import blend, bone_weights
from handpipe.tissues.tendons.rods.energies import EndForce
from handpipe.tissues.tendons.rods.rod import directions, frames, lay, perpendicular, segment_length, unit
from handpipe.tissues.tendons.rods.tube import Tube, round_surface

PULL = 0.5  # c1 |f| of Zheng et al. 2022, Table 2: the tension of the rod
SIDES = 16  # of a tube's section


@dataclass(frozen=True)
class RestTendon:
    """A tendon in neutral.

    Parameters
    ----------
    x : array (Q+1, 3)
        Rod in mm, from the insertion outwards.
    tube : Tube
        The surface that the rod carries.
    normal : array (3,)
        Unit normal of the first segment.
    bones : tuple of str
        Bones that the tendon passes, from the insertion outwards. The first carries the rod's first vertex;
        the last is the base, to which the pull's direction belongs.
    skinning : array (Q+1, n_bones)
        Smooth weights of the bones at the vertices.
    """

    x: Array
    tube: Tube
    normal: Array
    bones: tuple[str, ...]
    skinning: Array

    @staticmethod
    def build(x: Array, radii: Array | float, bones: Mapping[str, Surface]) -> RestTendon:
        """A round tube of given radii (Q+1,) about a rod; neutral bones, the insertion's first."""
        normal = perpendicular(directions(x)[0])
        tube = Tube.bind(round_surface(x, radii, SIDES), x, frames(x, normal))
        return RestTendon(x, tube, normal, tuple(bones), bone_weights(x, bones, power=4.0))

    @property
    def length(self) -> float:
        """Length of one segment in mm."""
        return segment_length(self.x)

    @property
    def pull_direction(self) -> Array:
        """Mean direction (3,) of the last tenth of the segments, outwards (sec. 5.1)."""
        return unit(directions(self.x)[-max(len(self.x) // 10, 3) :].mean(axis=0))

    def surface(self) -> Surface:
        """The tube's surface in neutral."""
        return Surface(self.tube.skin(self.x, frames(self.x, self.normal)), self.tube.triangles)

    def pull(self, bones: Mapping[str, RigidTransform]) -> EndForce:
        """The constant force at the free end, in the frame of `bones`."""
        return EndForce(PULL * bones[self.bones[-1]].rotation @ self.pull_direction)

    def first_normal(self, bones: Mapping[str, RigidTransform]) -> Array:
        """The first segment's normal (3,), carried by the insertion's bone."""
        return bones[self.bones[0]].rotation @ self.normal

    def skinned(self, bones: Mapping[str, RigidTransform]) -> Array:
        """The rest vertices (Q+1, 3) moved by smooth blends of the bones' transforms; lengths change."""
        return blend(self.x, self.skinning, {name: bones[name] for name in self.bones})

    def carried(self, bones: Mapping[str, RigidTransform]) -> Array:
        """A rod (Q+1, 3) of the right segment lengths along the skinned rest shape."""
        curve = self.skinned(bones)
        curve[0] = bones[self.bones[0]](self.x[:1])[0]
        end = bones[self.bones[-1]].rotation @ self.pull_direction
        return lay(curve, self.length, len(self.x) - 1, end)
