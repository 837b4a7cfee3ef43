"""A tendon as simulated: a rod that slides through hooks, and its surface (Zheng et al. 2022, sec. 5.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from handpipe.core import Array, ConvergenceError, RigidTransform, Shape, artifacts
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.posing import LocalPoseSpaces, PoseSpace
from handpipe.tissues.tendons.fitting.hooks import HookSet, closest_points, fit_hooks, past_end
from handpipe.tissues.tendons.fitting.motion import Bones, relative_to
from handpipe.tissues.tendons.rods.energies import Bend, Hooks, RodEnergy
from handpipe.tissues.tendons.rods.equilibrium import RodEquilibrium, solve
from handpipe.tissues.tendons.rods.rest import PULL, RestTendon
from handpipe.tissues.tendons.rods.rod import closest_on_rod, frames, lay, point_at
from handpipe.tissues.tendons.rods.tube import Tube

BEND_LENGTH = 2.0  # mm over which the rod rounds the kink at a hook
CALIBRATIONS = 6  # rounds in which rest lengths follow the tension


@dataclass(frozen=True)
class Tendon:
    """A tendon: its rest rod, its hooks and their corrections over poses.

    Parameters
    ----------
    name : str
        Name of the tendon.
    rest : RestTendon
        The tendon at rest.
    radius : float
        Radius in mm.
    hooks : HookSet
        The hooks.
    spaces : LocalPoseSpaces
        Pose spaces of the hooks' corrections: a hook follows the joints next to it.
    space : PoseSpace
        Pose space of all bones, in which `starts` are interpolated.
    starts : array (N, Q+1, 3)
        Offsets in mm from the skinned rest rod to the example rods, in the frame of the base bone. Solves
        start from their interpolation, near their answer, where sharply bent joints would have other
        equilibria nearby.
    """

    name: str
    rest: RestTendon
    radius: float
    hooks: HookSet
    spaces: LocalPoseSpaces
    space: PoseSpace
    starts: Array

    def solve(
        self, bones: Bones, flesh: Array | None = None, *, start: Array | None = None
    ) -> RodEquilibrium:
        """Static equilibrium of the rod (Eq. 4-12) in a pose.

        Parameters
        ----------
        bones : mapping of str to RigidTransform
            Bone transforms from neutral.
        flesh : array (n, 3), optional
            Vertices of the soft tissue in mm, where it carries hooks.
        start : array (Q+1, 3), optional
            Another rod to start from, in mm.

        Returns
        -------
        RodEquilibrium
            The rod x (Q+1, 3) in mm, in the frame of the bones.

        Raises
        ------
        ConvergenceError
            Where there is no equilibrium.
        """
        base = bones[self.rest.bones[-1]]
        relative = relative_to(
            {name: bones[name] for name in {*self.rest.bones, *self.space.bones}}, self.rest.bones[-1]
        )
        around = None if flesh is None else base.inverse()(flesh)
        x = self._start(relative) if start is None else base.inverse()(start)
        try:
            found = solve(self.energies(relative, around), x)
        except ConvergenceError as error:
            raise error.within(f"Tendon {self.name}") from error
        return replace(found, x=base(found.x))

    def energies(self, bones: Bones, flesh: Array | None = None) -> list[RodEnergy]:
        """Hooks, pull and bending; bones and flesh relative to the base bone."""
        hooks = Hooks(self.hook_positions(bones, flesh))
        return [hooks, self.rest.pull(bones), Bend(PULL * BEND_LENGTH**2, self.rest.length)]

    def hook_positions(self, bones: Bones, flesh: Array | None = None) -> Array:
        """Positions (k, 3) of the hooks with their corrections; bones and flesh relative to the base bone."""
        corrections = self.spaces.interpolate(self.hooks.corrections, self._near, bones)
        return self.hooks.carried(bones, flesh) + corrections

    @cached_property
    def _near(self) -> dict[str, Array]:
        """The share (k,) of each bone at the hooks: that of the rod, which is smooth along it."""
        segment, t, _ = closest_on_rod(self.hooks.rest, self.rest.x)
        return dict(zip(self.rest.bones, point_at(self.rest.skinning, segment, t).T, strict=True))

    def _start(self, bones: Bones) -> Array:
        curve = self.rest.skinned(bones) + self.space.interpolate(self.starts, bones)
        curve[0] = bones[self.rest.bones[0]](self.rest.x[:1])[0]
        return lay(curve, self.rest.length, len(curve) - 1, self.rest.pull_direction)

    def along(self, line: Array, bones: Bones) -> Array:
        """The rod (Q+1, 3) laid along a line (n, 3) in a pose, from the insertion on its bone.

        The line may begin before the insertion, and at either end.
        """
        bone = bones[self.rest.bones[0]]
        first, base = bone(self.rest.x[:1]), bones[self.rest.bones[-1]]
        ends = np.linalg.norm(line[[0, -1]] - first, axis=1)
        line = line if ends[0] <= ends[1] else line[::-1]
        [segment], _, _ = closest_on_rod(first, line)
        curve = np.concatenate([first, line[segment + 1 :]])
        pull = base.rotation @ self.rest.pull_direction
        return lay(curve, self.rest.length, len(self.rest.x) - 1, pull)

    def without_corrections(self) -> Tendon:
        """The same tendon, whose hooks follow bones and flesh alone."""
        hooks = replace(self.hooks, corrections=np.zeros_like(self.hooks.corrections))
        return replace(self, hooks=hooks)

    def by_inverse_distance(self) -> Tendon:
        """The same tendon, its corrections interpolated by the weights of Zheng 2022 Eq. 1."""
        return replace(self, spaces=self.spaces.by_inverse_distance())

    def frames(self, x: Array, bones: Bones) -> Array:
        """Untwisted frames (Q, 3, 3) of a rod x (Q+1, 3) in a pose."""
        return frames(x, self.rest.first_normal(bones))

    def surface(self, x: Array, bones: Bones) -> Surface:
        """The tube's surface about a rod x (Q+1, 3) in a pose."""
        return Surface(self.rest.tube.skin(x, self.frames(x, bones)), self.rest.tube.triangles)

    def save(self, path: str | Path, inputs: Sequence[str | Path] = ()) -> None:
        """Write the artifact of kind "tendon"."""
        tube, hooks = self.rest.tube, self.hooks
        data = {
            "name": self.name,
            "radius": self.radius,
            "bones": list(self.rest.bones),
            "rod": {"x": self.rest.x, "normal": self.rest.normal, "skinning": self.rest.skinning},
            "tube": {
                "triangles": tube.triangles,
                "first": tube.first,
                "weights": tube.weights,
                "local": tube.local,
            },
            "hooks": hooks.to_group(),
            "starts": self.starts,
            "pose_space": self.space.to_group(),
            "pose_spaces": self.spaces.to_group(),
        }
        lengths = ("radius", "rod/x", "tube/local", "hooks/rest", "hooks/corrections")
        units = dict.fromkeys(lengths, "mm")
        artifacts.write(path, data, kind="tendon", units=units, inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> Tendon:
        """Read what `save` wrote.

        Raises
        ------
        InputError
            Where the file is of another kind, or a number in it is not finite.
        """
        data = artifacts.read(path, "tendon", finite=True)
        bones = tuple(str(b) for b in data["bones"])
        rod, tube, hooks = data["rod"], data["tube"], data["hooks"]
        rest = RestTendon(rod["x"], Tube(**tube), rod["normal"], bones, rod["skinning"])
        return Tendon(
            str(data["name"]),
            rest,
            float(data["radius"]),
            HookSet.from_group(hooks, bones),
            LocalPoseSpaces.from_group(data.get("pose_spaces", dict.fromkeys(bones, data["pose_space"]))),
            PoseSpace.from_group(data["pose_space"]),
            data["starts"],
        )


@dataclass(frozen=True)
class RegisteredRods:
    """Rods in example poses, the neutral pose among them with the rest rod and identities.

    Parameters
    ----------
    rods : mapping of str to array (Q+1, 3)
        Rod of each pose in mm.
    poses : mapping of str to mapping of str to RigidTransform
        Transforms from neutral, by pose and bone.
    parents : mapping of str to str
        Parent of each bone, for the pose spaces.
    flesh : mapping of str to Shape, optional
        Soft tissue in each pose, if it may carry hooks.
    """

    rods: Mapping[str, Array]
    poses: Mapping[str, Mapping[str, RigidTransform]]
    parents: Mapping[str, str]
    flesh: Mapping[str, Shape] | None = None


def build_tendon(
    name: str,
    rest: RestTendon,
    radius: float,
    neutral_bones: Mapping[str, Surface],
    examples: RegisteredRods,
) -> Tendon:
    """A tendon with hooks that are fitted to registered rods.

    Parameters
    ----------
    name : str
        Name of the tendon.
    rest : RestTendon
        The tendon at rest.
    radius : float
        Radius in mm.
    neutral_bones : mapping of str to Surface
        Neutral surfaces of the bones in mm.
    examples : RegisteredRods
        Rods in the example poses.

    Returns
    -------
    Tendon
        The tendon, its corrections calibrated by simulation of the examples.

    Raises
    ------
    ConvergenceError
        Where the rod has no equilibrium in an example pose.
    """
    base, rods, poses, parents = rest.bones[-1], examples.rods, examples.poses, examples.parents
    relative = {pose: relative_to(poses[pose], base) for pose in rods}
    local = {pose: poses[pose][base].inverse()(x) for pose, x in rods.items()}
    space = PoseSpace.build(rest.bones, parents, relative)
    spaces = LocalPoseSpaces.build(rest.bones, parents, relative, "exponential")
    flesh = examples.flesh or {}
    around = {
        pose: replace(flesh[pose], vertices=poses[pose][base].inverse()(flesh[pose].vertices))
        for pose in rods
        if pose in flesh
    }
    given = (list(local.values()), list(relative.values()), list(around.values()))
    hooks = fit_hooks(rest.x, neutral_bones, rest.bones, *given)
    starts = np.stack([local[pose] - rest.skinned(bones) for pose, bones in relative.items()])
    tendon = Tendon(name, rest, radius, hooks, spaces, space, starts)
    for _ in range(CALIBRATIONS):
        tendon = _calibrated(tendon, local, relative, around)
    return tendon


def _calibrated(
    tendon: Tendon,
    rods: Mapping[str, Array],
    poses: Mapping[str, Bones],
    flesh: Mapping[str, Shape],
) -> Tendon:
    """Move each example's corrections by what the simulated rod misses of the registered one at the hooks.

    Under its pull, the rod lies a little inside the curve of its hooks: Eq. 4 alone never meets the examples.
    """
    corrections = tendon.hooks.corrections.copy()
    for n, (pose, rod) in enumerate(rods.items()):
        around = flesh[pose].vertices if flesh else None
        x = tendon.solve(poses[pose], around).x
        hooks = Hooks(tendon.hook_positions(poses[pose], around))
        hooks.refresh(x)
        contact = hooks.contacts(x)
        miss = closest_points(contact, past_end(rod)) - contact
        corrections[n] += np.where(hooks.engaged[:, None], miss, 0.0)
    return replace(tendon, hooks=replace(tendon.hooks, corrections=corrections))
