"""Exports and the frames artifact, read back by other libraries."""

import csv
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import h5py
import meshio
import numpy as np
import pygltflib
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from handpipe.core.errors import InputError
from handpipe.core.layer_registry import LAYERS
from handpipe.core.layers import Frame, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.hand import appearance
from handpipe.hand import frames as frames_module
from handpipe.hand.appearance import shown
from handpipe.hand.exports import export
from handpipe.hand.frames import (
    StoredFrames,
    failures_in,
    finished_frames,
    frame_angles,
    read_frames,
    read_simulated,
    write_frames,
)
from handpipe.hand.simulation import Failure

CUBE = np.array([[x, y, z] for x in (0, 10) for y in (0, 20) for z in (0, 30)], dtype=float)
TETS = np.array([[0, 6, 4, 7], [0, 2, 6, 7], [0, 3, 2, 7], [0, 1, 3, 7], [0, 5, 1, 7], [0, 4, 5, 7]])
if np.linalg.det(CUBE[TETS[0, 1:]] - CUBE[TETS[0, 0]]) < 0:
    TETS = TETS[:, [0, 2, 1, 3]]


def simulated(count: int = 3):
    ball = trimesh.creation.icosphere(subdivisions=1, radius=4.0)
    ball_rest, ball_cells = np.asarray(ball.vertices) + 5, np.asarray(ball.faces, dtype=np.int64)
    rod = np.column_stack([np.linspace(0, 9, 10), np.zeros(10), np.ones(10)])
    segments = np.column_stack([np.arange(9), np.arange(1, 10)])
    frames = []
    for i in range(count):
        turn = RigidTransform(Rotation.from_rotvec([0, 0.4 * i, 0.1]).as_matrix(), np.array([1.0, i, 0]))
        strain = np.random.default_rng(i).normal(size=(len(TETS), 6))
        shapes = {
            "bones": {"distal2": Shape(ball_rest, turn(ball_rest), ball_cells)},
            "tendons": {
                "flexor2": Shape(
                    rod,
                    turn(rod),
                    segments,
                    {"stretch": np.full(9, 1.0 + 0.1 * i)},
                    {"contact_motion": 0.01 * i},
                )
            },
            "muscles": {
                "lumbrical1": Shape(CUBE, turn(CUBE) * 1.1, TETS, {"strain": strain, "height": CUBE[:, 2]})
            },
        }
        frames.append((Frame(f"step_{10 - i}", {"MP2_flexion": 0.4 * i}, {"distal2": turn}), shapes))
    return frames


def test_boundary_of_tetrahedra_is_closed_outward_and_holds_their_volume():
    mesh = trimesh.Trimesh(CUBE, export.surface_triangles(TETS), process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(6000)


def test_frames_round_trip(tmp_path: Path):
    frames = simulated()
    write_frames(tmp_path / "frames.h5", frames)
    again = read_frames(tmp_path / "frames.h5")
    assert [f.name for f, _ in again] == [f.name for f, _ in frames]
    for (frame, layers), (frame2, layers2) in zip(frames, again, strict=True):
        assert frame2.angles == dict(frame.angles)
        np.testing.assert_array_equal(frame2.bones["distal2"].rotation, frame.bones["distal2"].rotation)
        np.testing.assert_array_equal(frame2.bones["distal2"].translation, frame.bones["distal2"].translation)
        assert {k: list(v) for k, v in layers2.items()} == {k: list(v) for k, v in layers.items()}
        for layer in layers:
            for body, shape in layers[layer].items():
                other = layers2[layer][body]
                for name in ("rest", "vertices", "cells"):
                    np.testing.assert_array_equal(getattr(other, name), getattr(shape, name))
                assert other.figures == shape.figures
                assert list(other.fields) == list(shape.fields)
                for name in shape.fields:
                    np.testing.assert_array_equal(other.fields[name], shape.fields[name])


def test_frames_store_a_body_once_and_with_units(tmp_path: Path):
    write_frames(tmp_path / "frames.h5", simulated())
    with h5py.File(tmp_path / "frames.h5") as file:
        assert file["bodies/muscles/lumbrical1/rest"].attrs["units"] == "mm"
        assert [*file["names"].asstr()[()]] == ["step_10", "step_9", "step_8"]
        assert file["frames/000000/angles"].attrs["units"] == "rad"
        assert list(file["frames/000001/layers/muscles/lumbrical1"]) == ["vertices", "fields", "figures"]
        motion = file["frames/000001/layers/tendons/flexor2/figures/contact_motion"]
        assert (motion[()], motion.attrs["units"]) == (0.01, "mm")


NAMES = [
    "a/b",
    "..",
    ".",
    "1",
    "1.0",
    "schöne {Faust} [links]",
    "x" * 300,
    "</script>",
    "sub/../../up",
    "'\"",
]


def test_frames_may_have_any_name(tmp_path: Path):
    """Names are content and never keys or paths, so that none is read as a folder or runs into another."""
    [(frame, layers), *_] = simulated(1)
    frames = [
        (replace(frame, name=name, angles={"MP2_flexion": 0.1 * i}), layers) for i, name in enumerate(NAMES)
    ]
    write_frames(tmp_path / "frames.h5", frames)
    again = read_frames(tmp_path / "frames.h5")
    assert [(f.name, f.angles) for f, _ in again] == [(f.name, f.angles) for f, _ in frames]
    export.write_vtu_series(tmp_path / "vtk", again)
    export.write_obj_sequence(tmp_path / "obj", again)
    export.write_glb(tmp_path / "hand.glb", again)
    for folder in ("vtk", "obj"):
        with open(tmp_path / folder / "frames.csv", newline="", encoding="utf-8") as file:
            assert [*csv.DictReader(file)] == [
                {"number": f"{i:04d}", "frame": name} for i, name in enumerate(NAMES)
            ]
    assert len([*tmp_path.glob("obj/*.obj")]) == len([*tmp_path.glob("vtk/bones/*.vtu")]) == len(NAMES)
    assert {p.name for p in tmp_path.iterdir()} == {"frames.h5", "vtk", "obj", "hand.glb"}
    mesh = pygltflib.GLTF2().load(str(tmp_path / "hand.glb")).meshes[0]
    assert mesh.extras["targetNames"] == NAMES


def test_failures_stand_beside_the_frames(tmp_path: Path):
    failures = [Failure("bad", "fat", "no equilibrium. Ümläut"), Failure("worse", "tendons", "")]
    write_frames(tmp_path / "frames.h5", simulated(1), failures=failures)
    frames, found = read_simulated(tmp_path / "frames.h5")
    assert ([f.name for f, _ in frames], found) == (["step_10"], failures)
    assert failures_in(tmp_path / "frames.h5") == failures
    with pytest.raises(InputError, match="cannot be read"):
        failures_in(tmp_path / "no.h5")
    write_frames(tmp_path / "frames.h5", [], failures=failures)
    assert read_simulated(tmp_path / "frames.h5") == ([], failures)


def test_finished_frames_are_those_of_the_same_pose_and_key(tmp_path: Path):
    path, frames = tmp_path / "partial.h5", simulated(2)
    wanted = [frame for frame, _ in simulated(3)]
    assert finished_frames(path, "k", wanted) == {}
    write_frames(path, frames, key="k")
    assert [*finished_frames(path, "k", wanted)] == ["step_10", "step_9"]
    assert finished_frames(path, "other", wanted) == {}
    moved = replace(wanted[0], angles={"MP2_flexion": 1.0})
    assert [*finished_frames(path, "k", [moved, wanted[1]])] == ["step_9"]
    path.write_bytes(path.read_bytes()[:3000])
    assert finished_frames(path, "k", wanted) == {}


def test_a_scene_of_which_no_frame_was_simulated_is_exported_empty(tmp_path: Path):
    export.write_glb(tmp_path / "hand.glb", [])
    assert pygltflib.GLTF2().load(str(tmp_path / "hand.glb")).meshes == []
    assert export.write_vtu_series(tmp_path, []) == export.write_obj_sequence(tmp_path, []) == []


def test_frames_refuse_a_body_whose_cells_change(tmp_path: Path):
    frames = simulated(2)
    frames[1][1]["muscles"]["lumbrical1"].cells = TETS[:-1]
    with pytest.raises(ValueError, match="lumbrical1"):
        write_frames(tmp_path / "frames.h5", frames)
    assert not list(tmp_path.iterdir())


def test_reading_another_artifact_as_frames_says_so(tmp_path: Path):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.attrs["kind"] = "rig"
    with pytest.raises(InputError, match="rig"):
        read_frames(tmp_path / "other.h5")


def test_pvd_leads_to_vtu_files_with_the_frames_points_and_fields(tmp_path: Path):
    frames = simulated()
    series = export.write_vtu_series(tmp_path, frames, fps=10)
    assert [p.name for p in series] == ["bones.pvd", "tendons.pvd", "muscles.pvd"]
    entries = ElementTree.parse(tmp_path / "muscles.pvd").getroot().findall("./Collection/DataSet")
    assert [float(e.get("timestep")) for e in entries] == pytest.approx([0, 0.1, 0.2])
    for entry, (_, layers) in zip(entries, frames, strict=True):
        mesh, shape = meshio.read(tmp_path / entry.get("file")), layers["muscles"]["lumbrical1"]
        np.testing.assert_allclose(mesh.points, shape.vertices, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(mesh.cells_dict["tetra"], TETS)
        plastic = mesh.cell_data_dict["plastic_deformation"]["tetra"].reshape(-1, 3, 3)
        xx, xy, xz, yy, yz, zz = shape.fields["strain"].T
        np.testing.assert_allclose(plastic, np.moveaxis([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], 2, 0))
        assert "strain" not in mesh.cell_data_dict
        np.testing.assert_array_equal(mesh.point_data["height"], CUBE[:, 2])
        np.testing.assert_allclose(mesh.points - mesh.point_data["displacement"], CUBE, atol=1e-12)
        assert set(mesh.cell_data_dict["layer"]["tetra"]) == {list(LAYERS).index("muscles")}
    rod = meshio.read(tmp_path / "tendons" / "flexor2-0002.vtu")
    np.testing.assert_allclose(rod.cell_data_dict["stretch"]["line"], 1.2)


def accessor(document: pygltflib.GLTF2, index: int) -> np.ndarray:
    a = document.accessors[index]
    view = document.bufferViews[a.bufferView]
    width = {"SCALAR": 1, "VEC3": 3}[a.type]
    dtype = {pygltflib.FLOAT: "<f4", pygltflib.UNSIGNED_INT: "<u4"}[a.componentType]
    raw = document.binary_blob()[view.byteOffset :]
    return np.frombuffer(raw, dtype, a.count * width).reshape(-1, width)


def test_glb_rest_plus_morph_target_is_the_frame(tmp_path: Path):
    frames = simulated()
    export.write_glb(tmp_path / "hand.glb", frames, fps=10)
    document = pygltflib.GLTF2().load(str(tmp_path / "hand.glb"))
    assert [m.name for m in document.meshes] == ["bones/distal2", "tendons/flexor2", "muscles/lumbrical1"]
    for mesh in document.meshes:
        layer, body = mesh.name.split("/")
        primitive = mesh.primitives[0]
        rest = accessor(document, primitive.attributes.POSITION)
        assert len(primitive.targets) == len(frames)
        for target, (_, layers) in zip(primitive.targets, frames, strict=True):
            position = rest + accessor(document, target["POSITION"])
            x, y, z = layers[layer][body].vertices.T  # every vertex of these bodies lies on the surface
            np.testing.assert_allclose(position, np.column_stack([x, z, -y]) * 1e-3, atol=1e-8)
    sampler = document.animations[0].samplers[0]
    np.testing.assert_allclose(accessor(document, sampler.input).ravel(), [0, 0.1, 0.2], rtol=1e-6)
    np.testing.assert_array_equal(accessor(document, sampler.output).reshape(3, 3), np.eye(3))


def test_glb_opens_in_trimesh_in_metres_with_outward_triangles(tmp_path: Path):
    export.write_glb(tmp_path / "hand.glb", simulated(1))
    scene = trimesh.load(tmp_path / "hand.glb")
    assert scene.geometry["muscles/lumbrical1"].volume == pytest.approx(6000e-9, rel=1e-4)


def test_nails_have_their_own_colour_in_glb(tmp_path: Path):
    frame, shapes = simulated(1)[0]
    skin = shapes["bones"]["distal2"]
    nail = (skin.rest[:, 2] > 7).astype(np.uint8)
    export.write_glb(
        tmp_path / "hand.glb", [(frame, {"fat": {"skin": replace(skin, fields={"nail": nail})}})]
    )
    document = pygltflib.GLTF2().load(str(tmp_path / "hand.glb"))
    [primitive] = document.meshes[0].primitives
    colours = accessor(document, primitive.attributes.COLOR_0)
    for marked, srgb in ((nail == 1, appearance.NAIL), (nail == 0, appearance.colour("skin"))):
        assert marked.any()
        np.testing.assert_allclose(
            colours[marked], np.tile(np.power(srgb, 2.2), (marked.sum(), 1)), rtol=1e-6
        )
    factor = document.materials[primitive.material].pbrMetallicRoughness.baseColorFactor
    assert factor[:3] == [1, 1, 1]  # colours of vertices multiply it


def test_a_skin_without_nails_beside_one_with_nails_has_the_tissues_colour(tmp_path: Path):
    frame, shapes = simulated(1)[0]
    plain = shapes["bones"]["distal2"]
    nails = replace(plain, fields={"nail": np.ones(len(plain.rest), np.uint8)})
    export.write_glb(tmp_path / "hand.glb", [(frame, {"m0": {"skin": nails}, "m1": {"skin": plain}})])
    document = pygltflib.GLTF2().load(str(tmp_path / "hand.glb"))
    [without] = document.meshes[1].primitives
    assert document.meshes[1].name == "m1/skin" and without.attributes.COLOR_0 is None
    factor = document.materials[without.material].pbrMetallicRoughness.baseColorFactor
    np.testing.assert_allclose(factor[:3], np.power(appearance.colour("skin"), 2.2), rtol=1e-6)


def test_what_is_shown_leaves_out_the_fat_beneath_a_skin():
    ball = Shape(CUBE, CUBE, TETS)
    layers = {"bones": {"distal2": ball}, "fat": {"skin": ball, "fat_tets": ball}}
    assert [(layer, body) for layer, body, _ in shown(layers)] == [("bones", "distal2"), ("fat", "skin")]
    assert [body for _, body, _ in shown({"fat": {"fat_tets": ball}})] == ["fat_tets"]


def test_obj_sequence_has_the_frames_points(tmp_path: Path):
    frames = simulated(2)
    paths = export.write_obj_sequence(tmp_path, frames)
    vertices = [
        s.vertices for layers in [frames[1][1]] for shapes in layers.values() for s in shapes.values()
    ]
    lines = paths[1].read_text(encoding="utf-8").splitlines()
    read = np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=float)
    np.testing.assert_allclose(read, np.concatenate(vertices), atol=1e-6)
    assert [line for line in lines if line.startswith("g ")] == [
        "g bones_distal2",
        "g tendons_flexor2",
        "g muscles_lumbrical1",
    ]


def test_stored_frames_are_those_of_the_files_one_file_at_a_time(tmp_path: Path, monkeypatch):
    made = simulated()
    files = [tmp_path / "frames-0.h5", tmp_path / "frames-1.h5"]
    write_frames(files[0], made[:2])
    write_frames(files[1], made[2:])
    opened = []
    monkeypatch.setattr(frames_module, "read_frames", lambda path: opened.append(path) or read_frames(path))
    stored = StoredFrames(files)
    assert stored.names == [frame.name for frame, _ in made] and len(stored) == 3 and not opened
    assert frame_angles(stored) == [dict(frame.angles) for frame, _ in made] and not opened
    for (frame, layers), (expected, shapes) in zip(stored, made, strict=True):
        assert frame.name == expected.name
        found = layers["muscles"]["lumbrical1"].vertices
        np.testing.assert_array_equal(found, shapes["muscles"]["lumbrical1"].vertices)
    assert opened == files
    assert [frame.name for frame, _ in stored[1:]] == stored.names[1:]
    with pytest.raises(IndexError):
        stored[3]


def test_a_long_scene_has_frames_in_equal_steps_at_their_times(tmp_path: Path, caplog, monkeypatch):
    made = [simulated(1)[0] for _ in range(9)]
    made = [(replace(frame, name=str(i)), layers) for i, (frame, layers) in enumerate(made)]
    drawn = sum(len(s.vertices) for layer in made[0][1].values() for s in layer.values())
    monkeypatch.setattr(export.numbers_in_glb, "__defaults__", (5 * 24 * drawn,))
    export.write_glb(tmp_path / "hand.glb", made, fps=10)
    document = pygltflib.GLTF2().load(str(tmp_path / "hand.glb"))
    names = document.meshes[0].extras["targetNames"]
    assert names == ["0", "2", "4", "6", "8"] and "it has 5 of them" in caplog.text
    times = document.accessors[document.animations[0].samplers[0].input]
    assert (times.count, times.min, times.max) == (5, [0.0], [pytest.approx(0.8)])
    assert export.numbers_in_glb(made, 10**9) == list(range(9))
