"""The textured scan that a simulated skin carries: against closed-form bends, and read by another library."""

from pathlib import Path

import numpy as np
import pygltflib
import pytest
import trimesh
from PIL import Image
from scipy.spatial.transform import Rotation

from handpipe.core import Frame, InputError, Shape
from handpipe.hand.exports.carried_scan import CarriedScan
from handpipe.hand.exports.scan_glb import placed_parts, write_scan_glb
from handpipe.hand.exports.textured_scan import read_textured
from handpipe.mesh.files import read_scan, texture_files
from handpipe.mesh.surfaces import Surface

LENGTH, RADIUS, BEND = 60.0, 10.0, 40.0  # mm; the bend is that of the tube's middle line


def tube(rings: int, around: int, radius: float = RADIUS, rough: float = 0.0) -> Surface:
    """An open tube along x, with bumps of some mm."""
    x, angle = np.meshgrid(
        np.linspace(0, LENGTH, rings), np.linspace(0, 2 * np.pi, around, endpoint=False), indexing="ij"
    )
    r = radius + rough * np.cos(2 * np.pi * x / 5) * np.cos(8 * angle)
    vertices = np.stack([x, r * np.cos(angle), r * np.sin(angle)], axis=2).reshape(-1, 3)
    ids = np.arange(rings * around).reshape(rings, around)
    a, b = ids[:-1].ravel(), ids[1:].ravel()
    c, d = np.roll(ids[1:], -1, axis=1).ravel(), np.roll(ids[:-1], -1, axis=1).ravel()
    return Surface(vertices, np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)]))


def bent(points):
    """Points with the tube's middle line on an arc: sections turn and stay plane."""
    angle, r = points[:, 0] / BEND, BEND + points[:, 2]
    return np.stack([r * np.sin(angle), points[:, 1], r * np.cos(angle) - BEND], axis=1)


def frames(skin: Surface, *moved):
    shapes = [Shape(skin.vertices, x, skin.triangles) for x in moved]
    return [(Frame(f"f{i}", {}, {}), {"fat": {"skin": shape}}) for i, shape in enumerate(shapes)]


def written_obj(folder: Path, surface: Surface) -> Path:
    """An OBJ file of two materials, a seam of texture along the tube, a place for each corner."""
    rng = np.random.default_rng(0)
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("front", "back"):
        Image.fromarray(rng.integers(0, 255, (16, 16, 3), np.uint8)).save(folder / f"{name}.png")
    (folder / "scan.mtl").write_text("newmtl front\nmap_Kd front.png\nnewmtl back\nmap_Kd back.png\n")
    along = surface.vertices[surface.triangles, 0].mean(axis=1)
    surface = Surface(surface.vertices, surface.triangles[np.argsort(along, kind="stable")])
    lines = ["mtllib scan.mtl", *("v {:.9f} {:.9f} {:.9f}".format(*v) for v in surface.vertices)]
    corners = surface.triangles.ravel()
    angle = np.arctan2(surface.vertices[corners, 2], surface.vertices[corners, 1]).reshape(-1, 3)
    # Around the seam a triangle's corners are on one side of the image.
    angle = np.where((np.ptp(angle, axis=1) > np.pi)[:, None] & (angle < 0), angle + 2 * np.pi, angle)
    places = np.stack([angle.ravel() / (4 * np.pi) + 0.3, surface.vertices[corners, 0] / LENGTH], axis=1)
    lines += ["vt {:.6f} {:.6f}".format(*place) for place in places]
    half = len(surface.triangles) // 2
    for number, triangle in enumerate(surface.triangles + 1):
        if number in (0, half):
            lines.append(f"usemtl {'front' if number == 0 else 'back'}")
        lines.append("f " + " ".join(f"{v}/{3 * number + k + 1}" for k, v in enumerate(triangle)))
    (folder / "scan.obj").write_text("\n".join(lines) + "\n")
    return folder / "scan.obj"


def test_a_rigid_motion_moves_the_scan_rigidly() -> None:
    skin, scan = tube(25, 20), tube(100, 80, RADIUS + 0.3, rough=0.2)
    turn = Rotation.from_rotvec([0.3, 1.2, -0.5])
    carried = CarriedScan.attach(scan.vertices, skin)(turn.apply(skin.vertices) + 5.0)
    np.testing.assert_allclose(carried, turn.apply(scan.vertices) + 5.0, atol=1e-9)


def test_a_bend_of_the_skin_bends_the_scan_the_better_the_finer_the_skin() -> None:
    scan = tube(100, 80, RADIUS + 0.3, rough=0.2)
    errors = [
        np.linalg.norm(
            CarriedScan.attach(scan.vertices, skin)(bent(skin.vertices)) - bent(scan.vertices), axis=1
        ).mean()
        for skin in (tube(25, 20), tube(49, 40))
    ]
    assert errors[0] < 0.02  # mm, with edges of 2.5 mm
    assert errors[1] == pytest.approx(errors[0] / 4, rel=0.1)


def test_a_scan_stays_as_far_from_the_skin_as_it_was() -> None:
    skin, scan = tube(25, 20), tube(50, 40, RADIUS + 0.5)
    carrier, posed = CarriedScan.attach(scan.vertices, skin), bent(skin.vertices)
    feet = np.einsum("nc,nci->ni", carrier.weights, posed[carrier.corners])
    gaps = np.linalg.norm(carrier(posed) - feet, axis=1)
    np.testing.assert_allclose(gaps, np.linalg.norm(carrier.offsets, axis=1), rtol=1e-9)


def test_another_library_reads_shape_texture_and_frames(tmp_path: Path) -> None:
    skin, scan = tube(25, 20), tube(50, 40, RADIUS + 0.2)
    parts = read_textured(written_obj(tmp_path, scan))
    path = tmp_path / "scan.glb"
    assert write_scan_glb(path, parts, frames(skin, skin.vertices, bent(skin.vertices))) == 0
    opened = trimesh.load_scene(path)
    assert len(opened.geometry) == len(parts) == 2
    for mesh, part in zip(opened.geometry.values(), parts, strict=True):
        np.testing.assert_allclose(in_mm(mesh.vertices), part.vertices, atol=1e-4)
        np.testing.assert_allclose(mesh.visual.uv, part.places, atol=1e-6)
        shown = np.asarray(mesh.visual.material.baseColorTexture.convert("RGB"))
        np.testing.assert_array_equal(shown, np.asarray(part.image))
    document = pygltflib.GLTF2().load(str(path))
    assert document.meshes[0].extras["targetNames"] == ["f0", "f1"]
    for mesh, part in zip(document.meshes, parts, strict=True):
        still, moved = (values(document, target["POSITION"]) for target in mesh.primitives[0].targets)
        assert np.abs(still).max() < 1e-9
        found = part.vertices + in_mm(moved)
        assert np.linalg.norm(found - bent(part.vertices), axis=1).mean() < 0.02


def test_shading_has_no_seam_where_the_texture_has_one(tmp_path: Path) -> None:
    skin, scan = tube(25, 20), tube(50, 40)
    parts = read_textured(written_obj(tmp_path, scan))
    assert sum(len(part.vertices) for part in parts) < 1.1 * len(scan.vertices)
    write_scan_glb(tmp_path / "scan.glb", parts, frames(skin, skin.vertices))
    document = pygltflib.GLTF2().load(str(tmp_path / "scan.glb"))
    for mesh, part in zip(document.meshes, parts, strict=True):
        normals = in_mm(values(document, mesh.primitives[0].attributes.NORMAL)) / 1e3
        inner = (part.vertices[:, 0] > 2) & (part.vertices[:, 0] < LENGTH - 2)
        halfway = np.abs(part.vertices[:, 0] - LENGTH / 2) < 2  # where one material ends
        radial = part.vertices[:, 1:] / RADIUS
        cosines = np.einsum("ni,ni->n", normals[:, 1:], radial)[inner & ~halfway]
        assert np.degrees(np.arccos(np.clip(cosines, -1, 1))).max() < 1.0


def test_images_and_corners_of_the_source_survive(tmp_path: Path) -> None:
    """Every corner of every triangle of the source is there with its own place in its own image."""
    scan = tube(20, 16)
    parts = read_textured(written_obj(tmp_path, scan))
    lines = (tmp_path / "scan.obj").read_text().splitlines()
    points = np.array([line.split()[1:] for line in lines if line.startswith("v ")], float)
    places = np.array([line.split()[1:] for line in lines if line.startswith("vt ")], float)
    corners = [word.split("/") for line in lines if line.startswith("f ") for word in line.split()[1:]]
    wanted = {(*points[int(v) - 1].round(6), *places[int(t) - 1].round(6)) for v, t in corners}
    found = {
        (*part.vertices[v].round(6), *part.places[v].round(6))
        for part in parts
        for v in part.triangles.ravel()
    }
    assert found == wanted
    assert sum(len(part.triangles) for part in parts) == len(scan.triangles)


def test_a_ply_file_with_corners_in_an_image_is_read(tmp_path: Path) -> None:
    image = np.random.default_rng(2).integers(0, 255, (8, 8, 3), np.uint8)
    Image.fromarray(image).save(tmp_path / "skin.png")
    rows = ["3 0 1 2 6 0 0 1 0 1 1", "3 0 2 3 6 0.5 0.5 1 1 0 1"]
    header = """ply
format ascii 1.0
comment TextureFile skin.png
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
property list uchar float texcoord
end_header
0 0 0
10 0 0
10 10 0
0 10 0
"""
    (tmp_path / "scan.ply").write_text(header + "\n".join(rows) + "\n")
    [part] = read_textured(tmp_path / "scan.ply")
    np.testing.assert_array_equal(np.asarray(part.image), image)
    corners = part.triangles.ravel()
    np.testing.assert_array_equal(part.places[corners], [[0, 0], [1, 0], [1, 1], [0.5, 0.5], [1, 1], [0, 1]])
    assert texture_files(tmp_path / "scan.ply") == [tmp_path / "skin.png"]


def test_colours_of_vertices_are_kept(tmp_path: Path) -> None:
    skin = tube(13, 12)
    colours = np.random.default_rng(1).integers(0, 255, (len(skin.vertices), 4), np.uint8)
    colours[:, 3] = 255
    file = tmp_path / "scan.ply"
    trimesh.Trimesh(skin.vertices, skin.triangles, vertex_colors=colours, process=False).export(file)
    [part] = read_textured(file)
    np.testing.assert_array_equal(part.colours, colours[:, :3])
    write_scan_glb(tmp_path / "scan.glb", [part], frames(skin, skin.vertices))
    document = pygltflib.GLTF2().load(str(tmp_path / "scan.glb"))
    linear = values(document, document.meshes[0].primitives[0].attributes.COLOR_0)
    np.testing.assert_allclose(255 * linear ** (1 / 2.2), colours[:, :3], atol=0.01)


def test_parts_go_where_the_scan_was_aligned_without_its_dust(tmp_path: Path) -> None:
    scan = tube(50, 40)
    dust = Surface(scan.vertices[:12] * 0.01 + [0, 40, 0], np.array([[0, 1, 2], [3, 4, 5]]))
    both = Surface(
        np.concatenate([dust.vertices, scan.vertices]),
        np.concatenate([dust.triangles, scan.triangles + len(dust.vertices)]),
    )
    file = written_obj(tmp_path, both)
    kept = read_scan(file)
    aligned = kept.moved(bent(kept.vertices) + 7.0)
    parts = placed_parts(read_textured(file), kept, aligned, file)
    assert sum(len(part.triangles) for part in parts) == len(scan.triangles)
    used = np.concatenate([part.vertices[part.triangles.ravel()] for part in parts])
    wanted = np.unique(np.round(aligned.vertices, 5), axis=0)
    np.testing.assert_allclose(np.unique(np.round(used, 5), axis=0), wanted, atol=2e-5)
    with pytest.raises(InputError, match="has 2000 vertices, but its alignment has 325"):
        placed_parts(read_textured(file), kept, tube(25, 13), file)


def test_what_is_far_from_the_skin_is_left_out(tmp_path: Path) -> None:
    skin, scan = tube(25, 20), tube(50, 40)
    longer = scan.moved(scan.vertices * [1.5, 1, 1])
    parts = read_textured(written_obj(tmp_path, longer))
    rest = frames(skin, skin.vertices)
    left_out = write_scan_glb(tmp_path / "scan.glb", parts, rest)
    beyond = (longer.vertices[longer.triangles, 0] > LENGTH + 3.0).any(axis=1).sum()
    assert left_out == beyond > 0
    away = read_textured(written_obj(tmp_path / "away", scan.moved(scan.vertices + [0, 100, 0])))
    with pytest.raises(InputError, match="no triangle of the scan is near the simulated skin"):
        write_scan_glb(tmp_path / "away.glb", away, rest)
    assert not (tmp_path / "away.glb").exists()


@pytest.mark.parametrize(("lost", "named_in"), [("scan.mtl", "scan.obj"), ("back.png", "scan.mtl")])
def test_a_lost_material_or_image_is_named(tmp_path: Path, lost: str, named_in: str) -> None:
    file = written_obj(tmp_path, tube(13, 12))
    assert [path.name for path in texture_files(file)] == ["scan.mtl", "front.png", "back.png"]
    (tmp_path / lost).unlink()
    with pytest.raises(InputError, match=rf"{named_in}: texture: names {lost}, which does not exist"):
        read_textured(file)


@pytest.mark.parametrize("options", ["-s 1 1 1 ", "-clamp on -o 0 0 0 "])
def test_options_of_an_image_do_not_lose_it(tmp_path: Path, options: str) -> None:
    file = written_obj(tmp_path, tube(13, 12))
    materials = tmp_path / "scan.mtl"
    materials.write_text(materials.read_text().replace("map_Kd ", f"map_Kd {options}"))
    parts = {tuple(np.asarray(part.image)[0, 0]) for part in read_textured(file)}
    assert parts == {tuple(np.asarray(Image.open(tmp_path / f"{n}.png"))[0, 0]) for n in ("front", "back")}


def test_a_damaged_image_is_named(tmp_path: Path) -> None:
    file = written_obj(tmp_path, tube(13, 12))
    (tmp_path / "back.png").write_bytes((tmp_path / "back.png").read_bytes()[:200])
    with pytest.raises(InputError, match=r"back.png: content: cannot be read"):
        read_textured(file)


def in_mm(vectors):
    """Vectors of glTF (m, y up) in mm, z up."""
    return 1e3 * np.asarray(vectors, float) @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]]


def values(document: pygltflib.GLTF2, accessor: int):
    """An accessor's vectors."""
    found = document.accessors[accessor]
    view = document.bufferViews[found.bufferView]
    raw = document.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
    return np.frombuffer(raw, "f4").reshape(found.count, -1)
