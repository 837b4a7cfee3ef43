"""Animated glTF of a skeleton, of skins on it, and of a corrective shape for each frame."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pygltflib as gltf
from scipy.spatial.transform import Rotation

from handpipe.core import Array, Frame, IntArray, RigidTransform, Shape, atomic
from handpipe.hand.appearance import surfaces_once, tissue
from handpipe.hand.exports.export import (
    TO_GLTF,
    GlbWriter,
    numbers_in_glb,
    surface_triangles,
    to_gltf,
    write_empty,
)
from handpipe.hand.exports.linear_blend import LinearBlend
from handpipe.hand.simulation import SimulatedFrame
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.rig import Rig

log = logging.getLogger(__name__)
AXES = 1e3 * TO_GLTF  # a rotation: z up to y up


def write_rigged_glb(
    path: str | Path, rig: Rig, frames: Sequence[SimulatedFrame], fps: float = 24.0
) -> float:
    """Write a skeleton with skinned bodies and a corrective shape for each frame, metres, y up.

    Each bone is a node at the centre of its joint, a child of its parent's node, with a rotation and a
    translation in each frame. Bones are skinned to their own node alone. Every other vertex has the weights
    of up to four bones; the corrective shape of a frame is added in neutral, before skinning, and gives the
    simulated shape exactly. A rigger may drive the skeleton otherwise and keep the shapes as correctives.
    Long scenes have frames in equal steps, as `write_glb` says.

    Parameters
    ----------
    path : path
        File to be written. Without frames it is an empty scene.
    rig : Rig
        Hierarchy of the bones, centres of the joints, neutral bone surfaces.
    frames : sequence of SimulatedFrame
        Frames in the order of time, with transforms of all bones.
    fps : float
        Frames per second.

    Returns
    -------
    float
        Largest distance in mm of a vertex, as skinned, from its simulated place, before rounding to float32.
    """
    if not frames:
        write_empty(path)
        return 0.0
    chosen = numbers_in_glb(frames)
    described: list[Frame] = []
    bodies: dict[tuple[str, str], dict[int, Shape]] = {}
    for place, number in enumerate(chosen):
        frame, layers = frames[number]
        described.append(frame)
        for layer, body, shape in surfaces_once(layers):
            bodies.setdefault((layer, body), {})[place] = shape
    writer = _RiggedWriter(rig, described, np.array(chosen) / fps)
    error = max((writer.add(*names, shapes) for names, shapes in bodies.items()), default=0.0)
    with atomic(path) as temporary:
        writer.writer.finish().save_binary(str(temporary))
    log.info("%d bodies on %d bones, skinned to %.2g mm", len(bodies), len(rig.bones), error)
    return error


class _RiggedWriter:
    """Collects a skeleton and skinned bodies into one glTF."""

    def __init__(self, rig: Rig, frames: Sequence[Frame], times: Array) -> None:
        self.rig = rig
        self.motions = [[frame.bones[bone] for bone in rig.bones] for frame in frames]
        self.writer = GlbWriter([frame.name for frame in frames], times, "LINEAR")
        self._add_skeleton()

    def add(self, layer: str, body: str, shapes: Mapping[int, Shape]) -> float:
        """Add a body by its shape in each frame; returns the largest error of the skinned frames in mm."""
        shape, writer = next(iter(shapes.values())), self.writer
        cells = surface_triangles(shape.cells)
        used, local = np.unique(cells, return_inverse=True)
        local = np.asarray(local, np.int64).reshape(cells.shape)
        rest = shape.rest[used]
        of_bone = layer == "bones" and body in self.rig.bones
        blend = (
            LinearBlend.rigid(len(rest), self.rig.bones.index(body))
            if of_bone
            else LinearBlend.near(rest, {name: self.rig.surfaces[name] for name in self.rig.bones})
        )
        moved = {number: found.vertices[used] for number, found in shapes.items()}
        before = {} if of_bone else {n: blend.before(x, self.motions[n], rest) for n, x in moved.items()}
        correctives = [] if of_bone else [before.get(n, rest) for n in range(len(self.motions))]
        primitive = self._primitive(rest, local, blend, correctives)
        writer.colour(primitive, tissue(layer, body), shape, used)
        self._add_mesh(f"{layer}/{body}", primitive)
        skinned = {n: blend(before.get(n, rest), self.motions[n]) for n in moved}
        return max(float(np.linalg.norm(skinned[n] - moved[n], axis=1).max()) for n in moved)

    def _primitive(
        self, rest: Array, cells: IntArray, blend: LinearBlend, shapes: Sequence[Array]
    ) -> gltf.Primitive:
        add = self.writer.accessor
        attributes = gltf.Attributes(
            POSITION=add(to_gltf(rest), gltf.ARRAY_BUFFER, bounds=True),
            JOINTS_0=add(blend.joints.astype(np.uint16), gltf.ARRAY_BUFFER),
            WEIGHTS_0=add(blend.weights.astype(np.float32), gltf.ARRAY_BUFFER),
        )
        targets = [{"POSITION": add(to_gltf(x - rest), bounds=True)} for x in shapes]
        if cells.shape[1] == 3:
            normals = to_gltf(1e3 * Surface(rest, cells).vertex_normals())
            attributes.NORMAL = add(normals, gltf.ARRAY_BUFFER)
            for target, x in zip(targets, shapes, strict=True):
                target["NORMAL"] = add(to_gltf(1e3 * Surface(x, cells).vertex_normals()) - normals)
        return gltf.Primitive(
            attributes=attributes,
            indices=add(cells.reshape(-1, 1).astype(np.uint32), gltf.ELEMENT_ARRAY_BUFFER),
            mode=gltf.LINES if cells.shape[1] == 2 else gltf.TRIANGLES,
            targets=targets,
        )

    def _add_mesh(self, name: str, primitive: gltf.Primitive) -> None:
        document, node = self.writer.document, len(self.writer.document.nodes)
        mesh = gltf.Mesh(name=name, primitives=[primitive])
        document.meshes.append(mesh)
        document.nodes.append(gltf.Node(name=name, mesh=len(document.meshes) - 1, skin=0))
        document.scenes[0].nodes.append(node)
        if primitive.targets:
            mesh.weights = [0.0] * len(primitive.targets)
            mesh.extras = {"targetNames": self.writer.names}
            self._channel(node, "weights", self.writer.weights)

    def _add_skeleton(self) -> None:
        """Nodes of the bones, their rest places, and their motion."""
        document, bones, parents = self.writer.document, self.rig.bones, self.rig.parents
        centres = self._centres()
        inverse = np.tile(np.eye(4, dtype=np.float32), (len(bones), 1, 1))
        for number, bone in enumerate(bones):
            origin = centres[parents[bone]] if bone in parents else np.zeros(3)
            children = [bones.index(b) for b in bones if parents.get(b) == bone]
            place = to_gltf((centres[bone] - origin)[None])[0].tolist()
            document.nodes.append(gltf.Node(name=bone, translation=place, children=children))
            inverse[number, 3, :3] = -to_gltf(centres[bone][None])[0]  # columns follow one another
        document.scenes[0].nodes.append(0)
        matrices = self.writer.accessor(inverse.reshape(-1, 16))
        joints = list(range(len(bones)))
        document.skins = [gltf.Skin(joints=joints, inverseBindMatrices=matrices, skeleton=0)]
        for number, bone in enumerate(bones):
            self._animate(number, bone, centres)

    def _animate(self, number: int, bone: str, centres: Mapping[str, Array]) -> None:
        """Rotation and translation of a bone's node relative to its parent's, in each frame."""
        bones, parent = self.rig.bones, self.rig.parents.get(bone)
        turns, places = [], []
        for motion in self.motions:
            above = RigidTransform.identity() if parent is None else motion[bones.index(parent)]
            relative = above.inverse() @ motion[number]
            origin = np.zeros(3) if parent is None else centres[parent]
            turns.append(AXES @ relative.rotation @ AXES.T)
            places.append(relative(centres[bone]) - origin)
        quaternions = _continuous(Rotation.from_matrix(np.stack(turns)).as_quat())
        add = self.writer.accessor
        self._channel(number, "rotation", add(quaternions.astype(np.float32)))
        self._channel(number, "translation", add(to_gltf(np.stack(places))))

    def _channel(self, node: int, what: str, output: int) -> None:
        animation = self.writer.document.animations[0]
        sampler = gltf.AnimationSampler(input=self.writer.times, output=output, interpolation="LINEAR")
        animation.samplers.append(sampler)
        target = gltf.AnimationChannelTarget(node=node, path=what)
        animation.channels.append(gltf.AnimationChannel(sampler=len(animation.samplers) - 1, target=target))

    def _centres(self) -> dict[str, Array]:
        """Neutral places of the bones' nodes: the centre of their joint; of the root, its middle."""
        found = {joint.child: np.asarray(joint.fit.centre, float) for joint in self.rig.joints}
        return {self.rig.root: self.rig.surfaces[self.rig.root].centroid(), **found}


def _continuous(quaternions: Array) -> Array:
    """The same rotations (n, 4) with signs such that none turns the long way from the one before."""
    dots = np.einsum("ni,ni->n", quaternions[1:], quaternions[:-1])
    return quaternions * np.concatenate([[1.0], np.cumprod(np.where(dots < 0, -1.0, 1.0))])[:, None]
