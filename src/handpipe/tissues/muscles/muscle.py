"""A muscle that can be simulated: its neutral body, and its plastic strains over poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy import sparse

from handpipe.core import Array, BoolArray, InputError, IntArray, RigidTransform, Shape, artifacts
from handpipe.fem.elements import plasticity
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.posing import Interpolation, PoseSpace
from handpipe.tissues.muscles.bed import Bed
from handpipe.tissues.muscles.fitting.pose_strains import (
    KnownShape,
    PoseStrains,
    StrainOptions,
    fit_pose_strains,
)
from handpipe.tissues.muscles.fitting.soft_body import ON_BONE, SoftBody
from handpipe.tissues.muscles.neighbours import touching

KIND = "muscle"
TOUCHING = 0.2  # mm to a neighbour: separated muscles that press on one another are 0.05 mm apart


@dataclass(frozen=True)
class Examples:
    """The example poses of a subject, in the rig's frame.

    Parameters
    ----------
    parents : mapping of str to str
        Parent of each bone.
    neutral : str
        Name of the neutral pose.
    transforms : mapping of str to mapping of str to RigidTransform
        Transforms from neutral by pose and bone, in the order of the result, without the neutral pose.
    interpolation : str
        Interpolation of the pose space.
    flesh : mapping of str to Shape, optional
        Soft tissue in neutral and in each of these poses, if it is known.
    """

    parents: Mapping[str, str]
    neutral: str
    transforms: Mapping[str, Mapping[str, RigidTransform]]
    interpolation: Interpolation = "rbf"
    flesh: Mapping[str, Shape] | None = None


@dataclass(frozen=True)
class SeparatedShape:
    """A muscle in an example pose, separated from what is around it.

    Parameters
    ----------
    surface : Surface
        Separated surface in mm. Its attached vertices lie on their bones.
    start : array (n, 3)
        Mesh vertices of stage 1 in mm.
    neighbours : sequence of Surface
        Other muscles and bones, into which the muscle must not be smoothed.
    """

    surface: Surface
    start: Array
    neighbours: Sequence[Surface] = ()


@dataclass(frozen=True)
class Muscle:
    """A muscle in neutral, and its plastic strains over poses.

    Parameters
    ----------
    name : str
        Name of the muscle.
    body : SoftBody
        The body in neutral.
    space : PoseSpace
        Its pose space. Neutral is one of the examples.
    logs : array (N, m, 6)
        Logarithms of the plastic strains of the examples, zero for neutral. Logarithms are interpolated, so
        that every strain between the examples is positive definite whatever the weights are.
    vertices : array (N, n, 3)
        The examples' mesh vertices in mm.
    bones : tuple of mapping of str to RigidTransform
        The examples' bone transforms.
    bed : Bed, optional
        The flesh that the muscle lies in, where that is known.
    """

    name: str
    body: SoftBody
    space: PoseSpace
    logs: Array
    vertices: Array
    bones: tuple[Mapping[str, RigidTransform], ...]
    bed: Bed | None = None

    @staticmethod
    def learn(name: str, body: SoftBody, examples: Examples, fit: PoseStrains) -> Muscle:
        """From the strains of example poses.

        Radial functions with a linear part follow the trend between examples, where positive weights are
        flat: measured in held-out poses of a phantom, surfaces were two to four times nearer to the truth.
        """
        still = {bone: RigidTransform.identity() for bone in body.attachments}
        own = [{b: t[b] for b in body.attachments} for t in examples.transforms.values()]
        poses = {examples.neutral: still, **examples.transforms}
        bones, places = list(body.attachments), body.attached_places
        space = PoseSpace.build(bones, examples.parents, poses, examples.interpolation, places)
        logs = np.stack([np.zeros((len(body.mesh.tets), 6)), *(plasticity.log(s) for s in fit.strains)])
        vertices = np.concatenate([body.mesh.vertices[None], fit.vertices])
        bed = None
        if examples.flesh:
            motions = [t[space.reference] for t in poses.values()]
            bed = Bed.fit(vertices, [examples.flesh[pose] for pose in poses], motions)
        return Muscle(name, body, space, logs, vertices, (still, *own), bed)

    @staticmethod
    def fit(
        name: str,
        body: SoftBody,
        examples: Examples,
        shapes: Mapping[str, SeparatedShape],
        options: StrainOptions | None = None,
    ) -> tuple[Muscle, PoseStrains]:
        """Stage 3: a muscle from its shapes by pose, those of all example poses.

        Without an example its strains are zero in every pose.
        """
        poses = examples.transforms
        if not poses:
            unknown = PoseStrains.unknown(body.mesh)
            return Muscle.learn(name, body, examples, unknown), unknown
        space = PoseSpace.build(list(body.attachments), examples.parents, poses, points=body.attached_places)
        given = [
            KnownShape(s.surface.vertices, s.start, touching(s.surface, s.neighbours, TOUCHING))
            for s in (shapes[pose] for pose in poses)
        ]
        fit = fit_pose_strains(body.mesh, body.matrix, given, space.examples, body.attached_vertices, options)
        return Muscle.learn(name, body, examples, fit), fit

    def places(
        self,
        bones: Mapping[str, Surface],
        transforms: Mapping[str, RigidTransform],
        flesh: Array | None = None,
    ) -> Array:
        """Mesh vertices (n, 3) where what surrounds the muscle takes them in a pose.

        Parameters
        ----------
        bones : mapping of str to Surface
            Neutral surfaces of the bones.
        transforms : mapping of str to RigidTransform
            Bone transforms of the pose.
        flesh : (n, 3), optional
            Vertices of the flesh's mesh in the pose. The muscle's vertices are where the flesh carries them,
            as far beside as between the examples, in directions that turn with the pose space's reference
            bone. Where no flesh is known, they are the examples themselves, each moved along with the bones,
            interpolated over the poses: from the nearest example alone, what lies between two would be in its
            neighbours.
        """
        if self.bed is not None:
            if flesh is None:
                raise ValueError(f"muscle {self.name} lies in the flesh, whose vertices are not given")
            beside = self.space.interpolate(self.bed.beside, transforms)
            return self.bed.embedding(flesh) + beside @ transforms[self.space.reference].rotation.T
        carried = self.body.followed(bones, transforms, list(zip(self.bones, self.vertices, strict=True)))
        return self.space.interpolate(np.stack(carried), transforms)

    def strains(self, bones: Mapping[str, RigidTransform]) -> Array:
        """Plastic strains (m, 6) in a pose (Zheng 2022 Eq. 2, in logarithms)."""
        return plasticity.exp(self.space.interpolate(self.logs, bones))

    @cached_property
    def firm(self) -> IntArray:
        """Surface vertices that go with a bone; the other marked ones leave theirs in an example."""
        return self.body.attached_vertices[self._firm]

    @cached_property
    def anchors(self) -> sparse.csr_matrix:
        """Matrix (f, n) from mesh vertices to the points at which the firm vertices are attached.

        These are drawn in to the mesh. Where the surface is thinner than a tet its vertices lie outside, up
        to twice the tet's height: a spring there can invert the tet.
        """
        return self._anchors[self._firm]

    def targets(self, bones: Mapping[str, RigidTransform]) -> Array:
        """Positions (f, 3) in a pose to which bones pull the anchors.

        They include the interpolated offset from the bone: separation can move attached vertices off it.
        """
        places = self._anchors @ self.body.mesh.vertices + self.space.interpolate(self._beside, bones)
        return self.body.carried(places, bones)[self._firm]

    @cached_property
    def _anchors(self) -> sparse.csr_matrix:
        attached = self.body.embedding.chosen(self.body.attached_vertices)
        return attached.drawn_in().matrix(len(self.body.mesh.vertices))

    @cached_property
    def _firm(self) -> BoolArray:
        return np.linalg.norm(self._beside, axis=2).max(axis=0) <= ON_BONE

    @cached_property
    def _beside(self) -> Array:
        """Offsets (N, t, 3) in mm of all anchors from neutral, in their bones' frames, in the examples."""
        back = [{bone: motion.inverse() for bone, motion in bones.items()} for bones in self.bones]
        places = [
            self.body.carried(self._anchors @ x, bones) for x, bones in zip(self.vertices, back, strict=True)
        ]
        return np.stack(places) - self._anchors @ self.body.mesh.vertices

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
        if self.bed is not None:
            data["bed"] = self.bed.to_group()
        units = {"body/vertices": "mm", "body/mesh/vertices": "mm", "logs": "1"}
        units |= {"examples/vertices": "mm", "examples/translations": "mm"}
        units |= {} if self.bed is None else {"bed/beside": "mm"}
        artifacts.write(path, data, kind=KIND, units=units, inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> Muscle:
        """Read what `save` wrote.

        Raises
        ------
        InputError
            Where the file is of another kind, or a mesh or number in it is not valid.
        """
        data = artifacts.read(path, KIND, finite=True)
        known = data["examples"]
        names = [str(n) for n in known["bones"]]
        bones = [
            {n: RigidTransform(r, t) for n, r, t in zip(names, rotations, translations, strict=True)}
            for rotations, translations in zip(known["rotations"], known["translations"], strict=True)
        ]
        body, space = SoftBody.from_group(data["body"]), PoseSpace.from_group(data["space"])
        body = replace(body, attachments={n: body.attachments[n] for n in names})
        body.surface.checked(path)
        body.mesh.checked(path)
        if data["logs"].shape[1] != len(body.mesh.tets):
            problem = f"are of {data['logs'].shape[1]} tets, but the muscle has {len(body.mesh.tets)}"
            raise InputError(path, "logs", problem, artifacts.REBUILD)
        bed = Bed.from_group(data["bed"]) if "bed" in data else None
        return Muscle(str(data["name"]), body, space, data["logs"], known["vertices"], tuple(bones), bed)
