"""A muscle that can be simulated: its neutral body, and its plastic strains over poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handpipe import artifacts
from handpipe.fem import plasticity
from handpipe.mesh.rigid import RigidTransform
from handpipe.mesh.surface import Surface
from handpipe.muscles.body import ON_BONE, Body
from handpipe.muscles.neighbours import touching
from handpipe.muscles.pose_strains import PoseStrains, StrainOptions, fit_pose_strains
from handpipe.skeleton.pose_space import Interpolation, PoseSpace

Array = NDArray[np.float64]

KIND = "muscle"
TOUCHING = 0.2  # mm to a neighbour: separated muscles that press on one another are 0.05 mm apart


@dataclass(frozen=True)
class Muscle:
    """name; body in neutral; space: its pose space, whose examples have the logarithms (N, m, 6) of plastic
    strains.

    Neutral is one of the examples, with logarithm zero. Logarithms are interpolated, so that every strain
    between the examples is positive definite whatever the weights are. vertices (N, n, 3) and bones are the
    examples' mesh vertices and bone transforms: where the search for an equilibrium begins.
    """

    name: str
    body: Body
    space: PoseSpace
    logs: Array
    vertices: Array
    bones: tuple[Mapping[str, RigidTransform], ...]

    @staticmethod
    def of(
        name: str,
        body: Body,
        parents: Mapping[str, str],
        neutral: str,
        transforms: Mapping[str, Mapping[str, RigidTransform]],
        fit: PoseStrains,
        interpolation: Interpolation = "rbf",
    ) -> Muscle:
        """From the strains of example poses, whose transforms are pose -> bone -> from neutral; parents: bone
        -> parent.

        Radial functions with a linear part follow the trend between examples, where positive weights are
        flat: measured in held-out poses of a phantom, surfaces were two to four times nearer to the truth.
        """
        still = {bone: RigidTransform.identity() for bone in body.attachments}
        own = [{b: t[b] for b in body.attachments} for t in transforms.values()]
        poses = {neutral: still, **transforms}
        space = PoseSpace.build(list(body.attachments), parents, poses, interpolation, body.held_by_bone)
        logs = np.stack([np.zeros((len(body.mesh.tets), 6)), *(plasticity.log(s) for s in fit.strains)])
        vertices = np.concatenate([body.mesh.vertices[None], fit.vertices])
        return Muscle(name, body, space, logs, vertices, (still, *own))

    @staticmethod
    def fit(
        name: str,
        body: Body,
        parents: Mapping[str, str],
        neutral: str,
        transforms: Mapping[str, Mapping[str, RigidTransform]],
        surfaces: Mapping[str, Surface],
        starts: Mapping[str, Array],
        options: StrainOptions | None = None,
        interpolation: Interpolation = "rbf",
        neighbours: Mapping[str, Sequence[Surface]] | None = None,
    ) -> tuple[Muscle, PoseStrains]:
        """Stage 3: a muscle from its separated surfaces and stage 1's mesh vertices (n, 3), both by pose.

        neighbours: other muscles and bones by pose, into which it is not to be smoothed. `transforms` holds
        the example poses, in the order of the result; held vertices of `surfaces` are seated.
        """
        space = PoseSpace.build(list(body.attachments), parents, transforms, points=body.held_by_bone)
        fit = fit_pose_strains(
            body.mesh,
            body.matrix,
            [surfaces[p].vertices for p in transforms],
            space.examples,
            [starts[p] for p in transforms],
            body.held,
            [touching(surfaces[p], (neighbours or {}).get(p, ()), TOUCHING) for p in transforms],
            options,
        )
        return Muscle.of(name, body, parents, neutral, transforms, fit, interpolation), fit

    def guess(self, bones: Mapping[str, Surface], transforms: Mapping[str, RigidTransform]) -> Array:
        """Mesh vertices (n, 3) of the examples, each moved along with the bones, interpolated over the poses;
        bones: neutral surfaces.

        From the nearest example alone, what lies between two would begin in its neighbours.
        """
        carried = self.body.followed(bones, transforms, list(zip(self.bones, self.vertices, strict=True)))
        return self.space.interpolate(np.stack(carried), transforms)

    def strains(self, bones: Mapping[str, RigidTransform]) -> Array:
        """Plastic strains (m, 6) in a pose (000 Eq. 2, in logarithms)."""
        return plasticity.exp(self.space.interpolate(self.logs, bones))

    def targets(self, bones: Mapping[str, RigidTransform]) -> Array:
        """Where held vertices (t, 3) are in a pose: at bones, and as far beside as between the examples.

        What lies on a bone goes with it, and is beside it by no more than rounding.
        """
        return self.body.targets(bones, self.space.interpolate(self._beside, bones))

    @cached_property
    def loose(self) -> NDArray[np.bool_]:
        """Which held vertices (t,) leave their bones in an example: soft tissue holds them, not bone."""
        return np.linalg.norm(self._beside, axis=2).max(axis=0) > ON_BONE

    @property
    def firm(self) -> NDArray[np.int64]:
        """Surface vertices that go with a bone."""
        return self.body.held[~self.loose]

    @cached_property
    def _beside(self) -> Array:
        """Offsets (N, t, 3) in mm of held vertices from neutral, in their bones' frames, in the examples."""
        body, held = self.body, self.body.held
        back = [{bone: motion.inverse() for bone, motion in bones.items()} for bones in self.bones]
        places = [
            body.carried(body.embedding(x)[held], bones) for x, bones in zip(self.vertices, back, strict=True)
        ]
        return np.stack(places) - body.surface.vertices[held]

    def save(self, path: str | Path, inputs: Sequence[str | Path] = ()) -> None:
        """Write the artifact."""
        names = list(self.body.attachments)
        data = {
            "name": self.name,
            "body": self.body.to_group(),
            "space": self.space.to_group(),
            "logs": self.logs,
            "examples/vertices": self.vertices,
            "examples/bones": names,
            "examples/rotations": np.array([[b[n].rotation for n in names] for b in self.bones]),
            "examples/translations": np.array([[b[n].translation for n in names] for b in self.bones]),
        }
        units = {"body/vertices": "mm", "body/mesh/vertices": "mm", "logs": "1"}
        units |= {"examples/vertices": "mm", "examples/translations": "mm"}
        artifacts.write(path, data, kind=KIND, units=units, inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> Muscle:
        """Read the artifact; raises `InputError` where it is not one."""
        data = artifacts.read(path, KIND)
        known = data["examples"]
        names = [str(n) for n in known["bones"]]
        bones = [
            {n: RigidTransform(r, t) for n, r, t in zip(names, rotations, translations, strict=True)}
            for rotations, translations in zip(known["rotations"], known["translations"], strict=True)
        ]
        body, space = Body.from_group(data["body"]), PoseSpace.from_group(data["space"])
        body = replace(body, attachments={n: body.attachments[n] for n in names})
        return Muscle(str(data["name"]), body, space, data["logs"], known["vertices"], tuple(bones))
