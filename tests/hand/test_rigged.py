"""The rigged glTF, posed by linear blend skinning of the test's own."""

from pathlib import Path

import numpy as np
import pygltflib
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from handpipe.core.layers import Frame, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.hand.exports.linear_blend import LinearBlend
from handpipe.hand.exports.rigged_glb import write_rigged_glb
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.joint_tree import RigJoint
from handpipe.skeleton.joints.joints import JointFit
from handpipe.skeleton.joints.residual import Residual
from handpipe.skeleton.rig.rig import Rig

BONES = ("palm", "first", "second", "third", "tip")
ANGLES = (0.0, 35.0, 80.0)  # degrees of every joint: 320 from end to end in the last frame
TOLERANCE = 1e-6  # m, as docs/artifacts.md states


def ball(x: float, radius: float = 4.0) -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    return Surface(np.asarray(mesh.vertices) + [x, 0, 0], np.asarray(mesh.faces))


def chain() -> Rig:
    """Five bones in a row along x; each joint turns about y half-way between two."""
    surfaces = {bone: ball(15.0 * i) for i, bone in enumerate(BONES)}
    limits = np.radians([[-10.0, 90.0]])
    still = Residual(np.zeros((2, 3)), *limits.T)
    joints = []
    for i, (parent, child) in enumerate(zip(BONES, BONES[1:], strict=False)):
        axis = Axes(np.array([[0.0, 1, 0]]), (0,))
        fit = JointFit(axis, np.array([15.0 * i + 7.5, 0, 0]), still, still, np.zeros((0, 1)))
        joints.append(RigJoint(child, parent, child, (f"{child}_flexion",), limits, fit))
    return Rig("palm", tuple(joints), dict(reversed(surfaces.items())), {})  # in an order of their own


def tube() -> Surface:
    mesh = trimesh.creation.cylinder(radius=6.0, height=80.0, sections=16)
    mesh = mesh.subdivide().subdivide()
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    return Surface(np.asarray(mesh.vertices) + [30, 0, 0], np.asarray(mesh.faces))


def frames(rig: Rig):
    """The skin follows its nearest bone and bulges: no linear blend gives that by itself."""
    made, skin = [], tube()
    rod = np.column_stack([np.linspace(0, 60, 20), np.zeros(20), np.full(20, 5.0)])
    near = np.clip(np.rint(skin.vertices[:, 0] / 15), 0, 4).astype(int)
    for number, angle in enumerate(ANGLES):
        angles = {name: np.radians(angle) for name in rig.angle_names}
        bones = rig.bone_transforms(
            angles,
            RigidTransform(
                Rotation.from_rotvec([0, 0, 0.2 * number]).as_matrix(), np.array([number, 0, 0.0])
            ),
        )
        posed = np.stack([bones[BONES[k]](x) for k, x in zip(near, skin.vertices, strict=True)])
        posed += number * 0.5 * np.sin(skin.vertices[:, [1, 2, 0]])
        rods = bones["second"](rod)
        layers = {
            "bones": {
                b: Shape(s.vertices, bones[b](s.vertices), s.triangles)
                for b, s in ((b, rig.surfaces[b]) for b in BONES)
            },
            "tendons": {
                "flexor": Shape(ball(20).vertices, bones["first"](ball(20).vertices), ball(20).triangles),
                "flexor_centreline": Shape(rod, rods, np.column_stack([np.arange(19), np.arange(1, 20)])),
            },
            "fat": {"skin": Shape(skin.vertices, posed, skin.triangles)},
        }
        made.append((Frame(f"f{number}", angles, bones), layers))
    return made


@pytest.fixture(scope="module")
def rigged(tmp_path_factory: pytest.TempPathFactory):
    path, rig = tmp_path_factory.mktemp("rigged") / "hand.glb", chain()
    made = frames(rig)
    error = write_rigged_glb(path, rig, made, fps=10)
    return path, pygltflib.GLTF2().load(str(path)), made, error


def read(document: pygltflib.GLTF2, index: int) -> np.ndarray:
    a = document.accessors[index]
    view = document.bufferViews[a.bufferView]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[a.type]
    dtype = {5126: "<f4", 5125: "<u4", 5123: "<u2"}[a.componentType]
    raw = document.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
    return np.frombuffer(raw, dtype, a.count * width).reshape(-1, width)


def animated(document: pygltflib.GLTF2, frame: int) -> dict[tuple[int, str], np.ndarray]:
    """What each node's channels say in a frame, by node and path."""
    found = {}
    for channel in document.animations[0].channels:
        sampler = document.animations[0].samplers[channel.sampler]
        count = document.accessors[sampler.input].count
        found[channel.target.node, channel.target.path] = read(document, sampler.output).reshape(count, -1)[
            frame
        ]
    return found


def global_matrices(document: pygltflib.GLTF2, moving: dict | None) -> list[np.ndarray]:
    """World matrices of all nodes, from the roots outwards."""
    found = [np.eye(4) for _ in document.nodes]

    def visit(node: int, above: np.ndarray) -> None:
        local = np.eye(4)
        place = document.nodes[node].translation or [0, 0, 0]
        local[:3, 3] = place if moving is None else moving.get((node, "translation"), place)
        if moving is not None and (node, "rotation") in moving:
            local[:3, :3] = Rotation.from_quat(moving[node, "rotation"]).as_matrix()
        found[node] = above @ local
        for child in document.nodes[node].children or []:
            visit(child, found[node])

    for root in document.scenes[0].nodes:
        visit(root, np.eye(4))
    return found


def posed(document: pygltflib.GLTF2, node: int, frame: int) -> np.ndarray:
    """Vertices of a mesh in a frame: morphed, then skinned, as the glTF specification has it."""
    moving, skin = animated(document, frame), document.skins[0]
    primitive = document.meshes[document.nodes[node].mesh].primitives[0]
    points = read(document, primitive.attributes.POSITION).astype(float)
    for weight, target in zip(moving.get((node, "weights"), []), primitive.targets or [], strict=True):
        points = points + weight * read(document, target["POSITION"])
    bind = read(document, skin.inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1).astype(float)
    worlds = global_matrices(document, moving)
    matrices = np.stack([worlds[j] @ b for j, b in zip(skin.joints, bind, strict=True)])
    weights = read(document, primitive.attributes.WEIGHTS_0).astype(float)
    blended = np.einsum("nk,nkij->nij", weights, matrices[read(document, primitive.attributes.JOINTS_0)])
    return np.einsum("nij,nj->ni", blended[:, :3, :3], points) + blended[:, :3, 3]


def test_skinned_and_corrected_vertices_are_the_simulated_ones(rigged) -> None:
    _, document, made, error = rigged
    assert error < 1e-9
    meshes = {n: i for i, node in enumerate(document.nodes) if node.mesh is not None for n in [node.name]}
    assert [*meshes] == [*(f"bones/{b}" for b in BONES), "tendons/flexor", "fat/skin"]  # nothing twice
    for frame, (_, layers) in enumerate(made):
        for name, node in meshes.items():
            layer, body = name.split("/")
            x, y, z = layers[layer][body].vertices.T
            expected = np.column_stack([x, z, -y]) * 1e-3
            np.testing.assert_allclose(posed(document, node, frame), expected, atol=TOLERANCE)


def test_the_skeleton_is_the_tree_of_joints_at_their_centres(rigged) -> None:
    _, document, made, _ = rigged
    assert [document.nodes[j].name for j in document.skins[0].joints] == list(BONES)
    assert [document.nodes[j].children for j in range(5)] == [[1], [2], [3], [4], []]
    rest = global_matrices(document, None)
    np.testing.assert_allclose(
        [rest[i][:3, 3] for i in range(5)],
        [[x, 0, 0] for x in (0, 0.0075, 0.0225, 0.0375, 0.0525)],
        atol=1e-8,
    )
    bind = read(document, document.skins[0].inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
    np.testing.assert_allclose([a @ b for a, b in zip(rest, bind, strict=False)], [np.eye(4)] * 5, atol=1e-7)
    for frame, (pose, _) in enumerate(made):
        worlds = global_matrices(document, animated(document, frame))
        tip = pose.bones["tip"](np.array([52.5, 0, 0])) * 1e-3
        np.testing.assert_allclose(worlds[4][:3, 3], [tip[0], tip[2], -tip[1]], atol=TOLERANCE)


def test_bones_are_skinned_to_themselves_without_correctives(rigged) -> None:
    _, document, _, _ = rigged
    for number, bone in enumerate(BONES):
        mesh = next(m for m in document.meshes if m.name == f"bones/{bone}")
        assert not mesh.primitives[0].targets and not mesh.weights
        assert set(read(document, mesh.primitives[0].attributes.JOINTS_0)[:, 0]) == {number}
    skin = next(m for m in document.meshes if m.name == "fat/skin")
    weights = read(document, skin.primitives[0].attributes.WEIGHTS_0)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-6)
    assert (weights >= 0).all() and (np.diff(weights, axis=1) <= 0).all()
    assert skin.extras["targetNames"] == ["f0", "f1", "f2"]


def test_turns_take_the_short_way(rigged) -> None:
    _, document, _, _ = rigged
    for channel in document.animations[0].channels:
        if channel.target.path == "rotation":
            turns = read(document, document.animations[0].samplers[channel.sampler].output)
            assert (np.einsum("ni,ni->n", turns[1:], turns[:-1]) > 0).all()


def test_trimesh_opens_it_in_metres(rigged) -> None:
    scene = trimesh.load(rigged[0])
    assert scene.geometry["fat/skin"].extents == pytest.approx([0.08, 0.012, 0.012], rel=0.05)


def test_without_frames_the_scene_is_empty(tmp_path: Path) -> None:
    assert write_rigged_glb(tmp_path / "a.glb", chain(), []) == 0
    assert pygltflib.GLTF2().load(str(tmp_path / "a.glb")).meshes == []


def test_a_vertex_whose_blend_collapses_is_left_as_it_is() -> None:
    """Half of each of two motions that are half a turn apart: no shape before it gives a shape after it."""
    half = RigidTransform(np.diag([-1.0, -1, 1]), np.zeros(3))
    blend = LinearBlend(np.array([[0, 1, 0, 0]] * 2), np.array([[0.5, 0.5, 0, 0], [0.9, 0.1, 0, 0]]))
    rest = np.array([[1.0, 2, 3], [1, 2, 3]])
    moved = np.array([[4.0, 5, 6], [4, 5, 6]])
    before = blend.before(moved, [RigidTransform.identity(), half], rest)
    np.testing.assert_array_equal(before[0], rest[0])
    np.testing.assert_allclose(blend(before, [RigidTransform.identity(), half])[1], moved[1])


def test_vertices_have_the_weights_of_the_bones_that_are_near(rigged) -> None:
    document = rigged[1]
    [node] = [n for n in document.nodes if n.name == "fat/skin"]
    attributes = document.meshes[node.mesh].primitives[0].attributes
    first = read(document, attributes.JOINTS_0)[:, 0]
    x = 1e3 * read(document, attributes.POSITION)[:, 0]
    expected = np.abs(x[:, None] - 15.0 * np.arange(5)).argmin(axis=1)
    assert np.mean(first == expected) > 0.95
