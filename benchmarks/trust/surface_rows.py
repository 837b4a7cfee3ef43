"""Rows of the readers' table: surfaces, tet meshes, marks and attachments as other programs write them."""

from __future__ import annotations

import json
import struct
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import trimesh

from benchmarks.trust.readers import Row, read_right, refused
from handpipe.core import Array, IntArray
from handpipe.imaging.evidence import read_landmarks, read_markers
from handpipe.imaging.volumes import Foreground, Volume, require_points_in_image, require_scan_in_image
from handpipe.mesh.files import read_scan, read_surface
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import read_tets
from handpipe.tissues.muscles.fitting import read_attachments, require_near_bones

CENTRE, RADIUS = np.array([20.0, -15.0, 30.0]), 12.0


def rows() -> list[Row]:
    """Every row of this table."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        tables = (_ply, _damaged_ply, _obj, _stl, _any_surface, _scans, _frames, _tets, _marks, _attachments)
        return [row for table in tables for row in table(folder)]


def ball() -> trimesh.Trimesh:
    """A sphere of 642 vertices."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=RADIUS)
    mesh.apply_translation(CENTRE)
    return mesh


def quads() -> tuple[Array, list[list[int]]]:
    """A box of 20 x 12 x 8 mm as six quads."""
    corners = np.array([[x, y, z] for x in (0.0, 20) for y in (0.0, 12) for z in (0.0, 8)])
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return corners, faces


def prism() -> tuple[Array, list[list[int]]]:
    """A prism 10 mm high over an L of six corners, which is not convex; its volume is 10 * 300 mm^3."""
    outline = np.array([[10.0, 10], [10, 20], [0, 20], [0, 0], [20, 0], [20, 10]])
    low, high = np.column_stack([outline, np.zeros(6)]), np.column_stack([outline, np.full(6, 10.0)])
    sides = [[i, i + 6, (i + 1) % 6 + 6, (i + 1) % 6] for i in range(6)]
    faces = [[*range(6)], [*range(11, 5, -1)], *sides]
    return np.vstack([low, high]), [face[::-1] for face in faces]


L_VOLUME, L_AREA = 3000.0, 2 * 300.0 + 80 * 10.0


def is_ball(surface: Surface) -> str:
    """What is wrong with a surface that should be `ball`."""
    known = ball()
    found = trimesh.Trimesh(surface.vertices, surface.triangles, process=False)
    if not surface.is_closed():
        return "is not closed"
    if abs(found.volume - known.volume) > 1e-4 * known.volume:
        return f"volume {found.volume:.2f}, not {known.volume:.2f}"
    if abs(found.area - known.area) > 1e-4 * known.area:
        return f"area {found.area:.2f}, not {known.area:.2f}"
    if np.abs(found.center_mass - CENTRE).max() > 1e-3:
        return f"its centre is {found.center_mass}"
    return ""


def is_ball_in_order(surface: Surface) -> str:
    """The same, and vertices in the file's order."""
    if len(surface.vertices) != len(ball().vertices):
        return f"{len(surface.vertices)} vertices"
    off = float(np.abs(surface.vertices - ball().vertices).max())
    return is_ball(surface) or ("" if off < 1e-4 else f"vertices up to {off:.3g} mm off")


def measures(volume: float, area: float) -> Callable[[Surface], str]:
    """Whether a surface is closed and has these measures."""

    def mistake(surface: Surface) -> str:
        if not surface.is_closed():
            return "is not closed"
        right = np.allclose([surface.volume(), surface.area()], [volume, area], rtol=1e-6)
        return "" if right else f"volume {surface.volume():.2f}, area {surface.area():.2f}"

    return mistake


@dataclass(frozen=True)
class Dialect:
    """How a PLY is written; order "" is text; extras are properties of type uchar or int."""

    order: str = "<"
    real: str = "float"
    length: str = "uchar"
    index: str = "int"
    name: str = "vertex_indices"
    vertex_extra: tuple[str, ...] = ()
    face_before: tuple[str, ...] = ()
    face_after: tuple[str, ...] = ()
    texture: bool = False
    more: str = ""


def write_ply(path: Path, vertices: Array, faces: list[list[int]], dialect: Dialect | None = None) -> Path:
    """Write a PLY of some dialect."""
    d = dialect or Dialect()
    codes = {"float": "f", "float32": "f", "double": "d", "uchar": "B", "uint8": "B", "int": "i"}
    codes |= {"uint": "I", "int32": "i", "ushort": "H", "short": "h"}
    kind = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}[d.order]
    lines = ["ply", f"format {kind} 1.0", "comment of a program", f"element vertex {len(vertices)}"]
    lines += [f"property {d.real} {axis}" for axis in "xyz"] + [f"property {p}" for p in d.vertex_extra]
    lines += [f"element face {len(faces)}", *(f"property {p}" for p in d.face_before)]
    lines += [f"property list {d.length} {d.index} {d.name}"]
    lines += ["property list uchar float texcoord"] * d.texture
    lines += [*(f"property {p}" for p in d.face_after), *([d.more] if d.more else []), "end_header"]
    rows: list[list[tuple[str, Any]]] = []
    extra = [(codes[p.split()[0]], 7) for p in d.vertex_extra]
    rows += [[*((codes[d.real], c) for c in vertex), *extra] for vertex in vertices]
    for face in faces:
        row: list[tuple[str, Any]] = [(codes[p.split()[0]], 3) for p in d.face_before]
        row += [(codes[d.length], len(face)), *((codes[d.index], i) for i in face)]
        row += [("B", 2 * len(face)), *[("f", 0.25)] * (2 * len(face))] if d.texture else []
        rows.append(row + [(codes[p.split()[0]], 200) for p in d.face_after])
    header = ("\n".join(lines) + "\n").encode()
    if d.order:
        body = b"".join(
            struct.pack(d.order + "".join(c for c, _ in row), *(v for _, v in row)) for row in rows
        )
    else:
        body = "".join(" ".join(f"{v:.9g}" for _, v in row) + "\n" for row in rows).encode()
    path.write_bytes(header + body)
    return path


def _closed(path: Path) -> Callable[[], Surface]:
    return lambda: read_surface(path, closed=True)


def _ply(folder: Path) -> list[Row]:
    mesh = ball()
    vertices, faces = mesh.vertices, mesh.faces.tolist()
    dialects: dict[str, dict[str, Any]] = {
        "text": {"order": ""},
        "text, vertex_index, float32": {"order": "", "real": "float32", "name": "vertex_index"},
        "text, texture coordinates": {"order": "", "texture": True},
        "little endian": {},
        "big endian": {"order": ">"},
        "big endian, double, colours": {
            "order": ">",
            "real": "double",
            "vertex_extra": ("uchar red", "uchar green", "uchar blue"),
        },
        "unsigned indices, long counts": {"length": "int", "index": "uint"},
        "short indices": {"index": "ushort"},
        "texture coordinates": {"texture": True},
        "face colours": {"face_after": ("uchar red", "uchar green", "uchar blue", "uchar alpha")},
        "property before the list": {"face_before": ("int flags",)},
        "normals and quality": {"vertex_extra": ("float nx", "float ny", "float nz", "double quality")},
        "element after faces": {"more": "element edge 0\nproperty int vertex1"},
    }
    found = []
    for dialect, options in dialects.items():
        path = write_ply(folder / "ball.ply", vertices, faces, Dialect(**options))
        found.append(read_right("PLY", dialect, _closed(path), is_ball_in_order))
    mesh.export(folder / "ball.ply")
    found.append(read_right("PLY", "trimesh", _closed(folder / "ball.ply"), is_ball_in_order))
    meshio.write(folder / "ball.ply", meshio.Mesh(mesh.vertices, [("triangle", mesh.faces)]))
    found.append(read_right("PLY", "meshio", _closed(folder / "ball.ply"), is_ball_in_order))
    for order in ("", "<", ">"):
        for dialect, shape, known in (
            ("quads", quads(), measures(1920.0, 2 * (240 + 160 + 96))),
            ("concave polygons beside quads", prism(), measures(L_VOLUME, L_AREA)),
        ):
            path = write_ply(folder / "polygons.ply", *shape, Dialect(order))
            kind = {"": "text", "<": "little endian", ">": "big endian"}[order]
            found.append(read_right("PLY", f"{kind}, {dialect}", _closed(path), known))
    text = write_ply(folder / "lines.ply", vertices, faces, Dialect("")).read_bytes()
    (folder / "lines.PLY").write_bytes(text.replace(b"\n", b"\r\n"))
    found.append(
        read_right("PLY", "CRLF, upper-case suffix", _closed(folder / "lines.PLY"), is_ball_in_order)
    )
    return found


def _damaged_ply(folder: Path) -> list[Row]:
    mesh = ball()
    good = write_ply(folder / "good.ply", mesh.vertices, mesh.faces.tolist()).read_bytes()
    text = write_ply(folder / "text.ply", mesh.vertices, mesh.faces.tolist(), Dialect("")).read_bytes()
    header = good[: good.index(b"end_header")]
    huge = header.replace(b"element vertex 642", b"element vertex 1000000000")
    # what is broken, the content, and what the message says
    contents: dict[str, tuple[bytes, str]] = {
        "empty": (b"", "is empty"),
        "another format": (b"solid ball\n", "does not begin with 'ply'"),
        "cut off": (good[:-100], "cut off"),
        "text cut off": (text[: len(text) // 2], "cut off"),
        "a billion vertices declared": (huge + b"end_header\n" + bytes(40), "1000000000 are declared"),
        "no end of header": (header, "end_header"),
        "unknown type": (good.replace(b"property float x", b"property quad x"), "property quad x"),
        "words among numbers": (text.replace(b"\n3 ", b"\nthree ", 1), "words among the numbers"),
        "points alone": (
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
            b"end_header\n0 0 0\n",
            "there are none",
        ),
        "strips": (good.replace(b"vertex_indices", b"tristrip_index"), "no list vertex_indices"),
    }
    found = []
    for defect, (content, reason) in contents.items():
        (folder / "damaged.ply").write_bytes(content)
        found.append(refused("PLY", "", defect, _closed(folder / "damaged.ply"), reason))
    faces = mesh.faces.tolist()
    faces[5] = [0, 1, 100_000]
    path = write_ply(folder / "index.ply", mesh.vertices, faces)
    found.append(refused("PLY", "", "index beyond the vertices", _closed(path), "face 5 names vertex 100000"))
    return found


def _obj(folder: Path) -> list[Row]:
    mesh = ball()
    points = "".join("v {:.9f} {:.9f} {:.9f}\n".format(*v) for v in mesh.vertices)
    n = len(mesh.vertices)
    corners = mesh.faces + 1

    def faces(corner: Callable[[int], str]) -> str:
        return "".join("f " + " ".join(corner(i) for i in face) + "\n" for face in corners.tolist())

    texts = {
        "v": points + faces(str),
        "v/vt seams": points + "vt 0 0\nvt 1 0\n" * n + faces(lambda i: f"{i}/{(7 * i) % n + 1}"),
        "v//vn groups and objects": "mtllib a.mtl\no ball\n"
        + points
        + "vn 0 0 1\ng upper\nusemtl skin\ns 1\n"
        + faces(lambda i: f"{i}//1"),
        "v/vt/vn": points + "vt 0 0\nvn 0 0 1\n" + faces(lambda i: f"{i}/1/1"),
        "negative indices": points + faces(lambda i: str(i - n - 1)),
        "colours, blanks and comments": "# made by hand\n\n"
        + points.replace("\n", " 0.5 0.5 0.5\n").replace("v ", "v  ")
        + faces(lambda i: f"\t{i}"),
        "continued lines": points + faces(lambda i: f"{i} \\\n"),
    }
    found = []
    for dialect, text in texts.items():
        (folder / "ball.obj").write_text(text)
        found.append(read_right("OBJ", dialect, _closed(folder / "ball.obj"), is_ball_in_order))
    for dialect, (vertices, polygons), known in (
        ("quads", quads(), measures(1920.0, 2 * (240 + 160 + 96))),
        ("concave polygons", prism(), measures(L_VOLUME, L_AREA)),
    ):
        text = "".join("v {} {} {}\n".format(*v) for v in vertices)
        text += "".join("f " + " ".join(str(i + 1) for i in face) + "\n" for face in polygons)
        (folder / "polygons.obj").write_text(text)
        found.append(read_right("OBJ", dialect, _closed(folder / "polygons.obj"), known))
    split = "".join("v {:.9f} {:.9f} {:.9f}\n".format(*v) for v in mesh.vertices[mesh.faces].reshape(-1, 3))
    split += "".join(f"f {3 * i + 1} {3 * i + 2} {3 * i + 3}\n" for i in range(len(mesh.faces)))
    (folder / "split.obj").write_text(split)
    found.append(read_right("OBJ", "every triangle its own vertices", _closed(folder / "split.obj"), is_ball))
    for defect, text, reason in (
        ("vertex 0", points + "f 0 1 2\n", f"line {n + 1}: names a vertex"),
        ("no number", points + "v 1 2 three\n" + faces(str), "three"),
        ("nothing of OBJ", "\x7fELF binary", "there are none"),
        ("crossing polygon", "v 0 0 0\nv 9 9 0\nv 9 0 0\nv 0 7 0\nv 4 9 0\nf 1 2 3 4 5\n", "crosses itself"),
    ):
        (folder / "damaged.obj").write_text(text)
        found.append(refused("OBJ", "", defect, _closed(folder / "damaged.obj"), reason))
    return found


def _stl(folder: Path) -> list[Row]:
    mesh = ball()
    binary = trimesh.exchange.stl.export_stl(mesh)
    text = trimesh.exchange.stl.export_stl_ascii(mesh).encode()
    solid = b"solid of a program that writes binary".ljust(80) + binary[80:]
    found = []
    for dialect, content in (
        ("binary", binary),
        ("text", text),
        ("text, upper case", text.upper()),
        ("binary that begins with solid", solid),
        ("bytes after the last triangle", binary + b"\n"),
    ):
        (folder / "ball.stl").write_bytes(content)
        found.append(read_right("STL", dialect, _closed(folder / "ball.stl"), is_ball))
    huge = binary[:80] + (10**9).to_bytes(4, "little") + binary[84:200]
    for defect, content, reason in (
        ("cut off", binary[:-60], "bytes"),
        ("text cut off", text[: len(text) // 2], "facets begin"),
        ("a billion triangles declared", huge, "bytes"),
    ):
        (folder / "damaged.stl").write_bytes(content)
        found.append(refused("STL", "", defect, _closed(folder / "damaged.stl"), reason))
    return found


def _any_surface(folder: Path) -> list[Row]:
    """Defects of geometry, whatever the format."""
    mesh = ball()
    vertices, faces = mesh.vertices, mesh.faces.tolist()
    path = folder / "surface.ply"

    def write(v: Array, f: list[list[int]]) -> Callable[[], Surface]:
        target = folder / f"surface-{len(list(folder.iterdir()))}.ply"
        return _closed(write_ply(target, v, f, Dialect(real="double")))

    nan = vertices.copy()
    nan[3, 1] = np.nan
    two = np.vstack([vertices, vertices + [40.0, 0, 0]])
    inside_out = [*faces, *([c + len(vertices), a + len(vertices), b + len(vertices)] for a, c, b in faces)]
    read = [
        read_right("surface", "inside out", write(vertices, [f[::-1] for f in faces]), is_ball),
        read_right("surface", "degenerate triangles", write(vertices, [*faces, [4, 4, 9]]), is_ball),
        read_right(
            "surface", "vertices of no triangle", write(np.vstack([vertices, [[1e6] * 3]]), faces), is_ball
        ),
        read_right(
            "surface",
            "one of two parts inside out",
            write(two, inside_out),
            measures(2 * mesh.volume, 2 * mesh.area),
        ),
    ]
    fin = [*faces, [faces[0][0], faces[0][1], len(vertices)]]
    bad = [
        refused("surface", "", "NaN", write(nan, faces), "NaN or infinite coordinates in 1 vertices"),
        refused("surface", "", "open", write(vertices, faces[1:]), "3 boundary edges, the first near ("),
        refused("surface", "", "metres", write(vertices / 1000, faces), "metres"),
        refused("surface", "", "micrometres", write(vertices * 1000, faces), "micrometres"),
        refused(
            "surface", "", "a triangle turned", write(vertices, [faces[0][::-1], *faces[1:]]), "opposite"
        ),
        refused("surface", "", "a fin", write(np.vstack([vertices, [[0.0] * 3]]), fin), "boundary edges"),
        refused("surface", "", "missing", _closed(folder / "none.ply"), "does not exist"),
        refused("surface", "", "unknown suffix", _closed(path.with_suffix(".off")), "does not exist"),
    ]
    odd = folder / "Müller (links) {1} [a]"
    odd.mkdir(exist_ok=True)
    named = _closed(write_ply(odd / "Ball ä.ply", vertices, faces))
    return [
        *read,
        *bad,
        read_right("surface", "path with umlauts, blanks, brackets", named, is_ball_in_order),
    ]


def _scans(folder: Path) -> list[Row]:
    mesh = ball()
    vertices, faces = mesh.vertices, mesh.faces.tolist()

    def with_ball(radius: float, shift: float) -> Path:
        other = trimesh.creation.icosphere(subdivisions=2, radius=radius)
        both = np.vstack([vertices, other.vertices + CENTRE + [shift, 0, 0]])
        path = folder / f"scan-{radius}-{shift}.ply"
        more = (other.faces + len(vertices)).tolist()
        return write_ply(path, both, [*faces, *more], Dialect(real="double"))

    dust, island, wart = with_ball(0.5, 20), with_ball(2.1, 20), with_ball(3.0, RADIUS)
    expected = measures(mesh.volume + 0.0, mesh.area)
    return [
        read_right("scan", "dust beside it", lambda: read_scan(dust), expected),
        read_right(
            "scan",
            "a part that cuts the skin",
            lambda: read_scan(wart),
            lambda s: str(len(s.components()) - 2 or ""),
        ),
        refused(
            "scan", "", "island of 3 % of its area", lambda: read_scan(island), "1 of 2 parts touch no other"
        ),
    ]


def phantom() -> tuple[Surface, Volume]:
    """A body that has no symmetry in an image with air around it, and its scan."""
    parts = ((-14.0, 6.0, 0.0, 9.0), (2.0, 0.0, 4.0, 12.0), (20.0, -8.0, -3.0, 7.0))
    centre = np.array([40.0, 25.0, -30.0])
    spheres = [trimesh.creation.icosphere(subdivisions=3, radius=p[3]) for p in parts]
    for sphere, part in zip(spheres, parts, strict=True):
        sphere.apply_translation(centre + part[:3])
    scan = Surface(
        np.vstack([s.vertices for s in spheres]),
        np.vstack([s.faces + 642 * i for i, s in enumerate(spheres)]),
    )
    affine = np.diag([2.5, 2.5, 2.5, 1.0])
    affine[:3, 3] = centre - 50.0
    points = np.moveaxis(np.indices((40, 40, 40)), 0, -1) @ affine[:3, :3].T + affine[:3, 3]
    body = np.any([np.linalg.norm(points - centre - p[:3], axis=-1) < p[3] for p in parts], axis=0)
    noise = 5 * np.random.default_rng(0).random(body.shape)
    return scan, Volume((100.0 * body + noise).astype(np.float32), affine)


def _frames(folder: Path) -> list[Row]:
    scan, volume = phantom()
    image = Foreground.threshold(volume)
    turned = Volume(volume.values.transpose(1, 0, 2).copy(), volume.affine)

    def given(matrix: Array) -> Callable[[], float]:
        moved = scan.moved(scan.vertices @ matrix.T)
        return lambda: require_scan_in_image("scan.ply", moved, image, {})

    points = scan.vertices[::50]
    labels = [str(i) for i in range(len(points))]

    def marks(matrix: Array) -> Callable[[], None]:
        return lambda: require_points_in_image("marks", points @ matrix.T, labels, image, "the image")

    lps = np.diag([-1.0, -1.0, 1.0])
    found = [
        read_right(
            "scan", "in its image", given(np.eye(3)), lambda dice: "" if dice > 0.9 else f"Dice {dice:.2f}"
        ),
        read_right("marks", "in their image", marks(np.eye(3)), lambda _: ""),
        refused("marks", "LPS", "not RAS", marks(lps), "LPS"),
        refused("marks", "inches", "not mm", marks(np.eye(3) / 25.4), "inches"),
        refused("scan", "LPS", "not RAS", given(lps), "LPS"),
        refused("scan", "mirrored", "not RAS", given(np.diag([-1.0, 1.0, 1.0])), "mirrored in x"),
    ]
    for unit, factor in (("centimetres", 0.1), ("inches", 1 / 25.4), ("micrometres", 1000.0)):
        found.append(refused("scan", unit, "not mm", given(factor * np.eye(3)), unit))
    swapped = Foreground.threshold(turned)
    found.append(
        refused(
            "scan",
            "of another pose",
            "files exchanged",
            lambda: require_scan_in_image("scan.ply", scan, swapped, {"flat": lambda: image}),
            "pose 'flat'",
        )
    )
    return found


def _cube() -> tuple[Array, IntArray]:
    """A cube of 10 mm as six tets."""
    corners = 10.0 * np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    paths = [[0, a, a + b, 7] for a in (1, 2, 4) for b in (1, 2, 4) if a != b]
    tets = np.array(paths)
    x = corners[tets]
    turned = np.linalg.det(x[:, 1:] - x[:, :1]) < 0
    tets[turned] = tets[turned][:, [0, 2, 1, 3]]
    return corners, tets


def _tets(folder: Path) -> list[Row]:
    corners, tets = _cube()

    def is_cube(mesh: Any) -> str:
        return "" if abs(mesh.volumes().sum() - 1000) < 1e-3 and len(mesh.tets) == 6 else "is another body"

    def write(name: str, points: Array, cells: list[tuple[str, Any]], **options: Any) -> Callable[[], Any]:
        meshio.write(folder / name, meshio.Mesh(points, cells), **options)
        return lambda: read_tets(folder / name)

    found = [
        read_right("tets", "VTK", write("a.vtk", corners, [("tetra", tets)]), is_cube),
        read_right("tets", "VTK text", write("b.vtk", corners, [("tetra", tets)], binary=False), is_cube),
        read_right("tets", "VTU", write("a.vtu", corners, [("tetra", tets)]), is_cube),
        read_right(
            "tets", "Gmsh 4.1", write("a.msh", corners, [("tetra", tets)], file_format="gmsh"), is_cube
        ),
        read_right(
            "tets", "Gmsh 2.2", write("b.msh", corners, [("tetra", tets)], file_format="gmsh22"), is_cube
        ),
        read_right("tets", "MEDIT", write("a.mesh", corners, [("tetra", tets)]), is_cube),
        read_right(
            "tets",
            "with boundary triangles",
            write("c.vtk", corners, [("triangle", tets[:, :3]), ("tetra", tets)]),
            is_cube,
        ),
        read_right(
            "tets", "inside out", write("d.vtk", corners, [("tetra", tets[:, [1, 0, 2, 3]])]), is_cube
        ),
        read_right(
            "tets",
            "every tet its own vertices",
            write("e.vtk", corners[tets].reshape(-1, 3), [("tetra", np.arange(24).reshape(-1, 4))]),
            is_cube,
        ),
    ]
    (folder / "UPPER.VTK").write_bytes((folder / "a.vtk").read_bytes())
    found.append(read_right("tets", "upper-case suffix", lambda: read_tets(folder / "UPPER.VTK"), is_cube))
    mixed = tets.copy()
    mixed[2] = mixed[2][[1, 0, 2, 3]]
    middles = np.vstack([corners, (corners[[0, 0, 0, 1, 1, 2]] + corners[[1, 2, 4, 2, 4, 4]]) / 2])
    quadratic = np.array([[0, 1, 2, 4, 8, 11, 9, 10, 12, 13]])
    hinged = np.vstack([tets, [[4, 5, 8, 9]]])  # on an edge of the cube
    nan = corners.copy()
    nan[0] = np.nan
    for defect, reader, reason in (
        ("quadratic tets", write("f.vtk", middles, [("tetra10", quadratic)]), "tetra10"),
        (
            "hexahedra beside tets",
            write(
                "g.vtk",
                np.vstack([corners, corners + 20]),
                [("tetra", tets), ("hexahedron", [[8, 9, 11, 10, 12, 13, 15, 14]])],
            ),
            "hexahedron",
        ),
        ("a surface", write("h.vtk", corners, [("triangle", tets[:, :3])]), "there are none"),
        ("an inverted tet", write("i.vtk", corners, [("tetra", mixed)]), "1 of 6 inverted or flat"),
        ("a tet twice", write("j.vtk", corners, [("tetra", np.vstack([tets, tets[:1]]))]), "there twice"),
        ("NaN", write("k.vtk", nan, [("tetra", tets)]), "NaN"),
        ("metres", write("l.vtk", corners / 1000, [("tetra", tets)]), "metres"),
        (
            "two parts",
            write("m.vtk", np.vstack([corners, corners + 20]), [("tetra", np.vstack([tets, tets + 8]))]),
            "in 2 parts",
        ),
        (
            "two parts that share an edge",
            write("r.vtk", np.vstack([corners, [[30.0, 0, 0], [30, 9, 9]]]), [("tetra", hinged)]),
            "in 2 parts that share no face",
        ),
        ("index beyond the vertices", write("n.vtk", corners, [("tetra", tets + 3)]), "do not exist"),
    ):
        found.append(refused("tets", "VTK", defect, reader, reason))
    whole = (folder / "a.vtk").read_bytes()
    declared = {
        "o.vtk": whole.replace(b"POINTS 8", b"POINTS 1000000000"),
        "p.msh": b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1000000000\n1 0 0 0\n$EndNodes\n",
    }
    for name, content in declared.items():
        (folder / name).write_bytes(content)
        found.append(
            refused(
                "tets",
                name[2:],
                "a billion points declared",
                partial(read_tets, folder / name),
                "is declared",
            )
        )
    (folder / "q.vtk").write_bytes(whole[: len(whole) // 2])
    found.append(refused("tets", "VTK", "cut off", lambda: read_tets(folder / "q.vtk"), "cannot be read"))
    return found


def _marks(folder: Path) -> list[Row]:
    placed = [[1.0, 2, 3], [4, 5, 6], [7, 8, 9]]

    def points(*changes: dict[str, Any]) -> list[dict[str, Any]]:
        every: list[dict[str, Any]] = [
            {"label": f"F-{i}", "position": p, "positionStatus": "defined"} for i, p in enumerate(placed)
        ]
        return [p | (changes[i] if i < len(changes) else {}) for i, p in enumerate(every)]

    def write(*markups: dict[str, Any]) -> Path:
        path = folder / f"{len(list(folder.glob('*.mrk.json')))}.mrk.json"
        path.write_text(json.dumps({"markups": list(markups)}))
        return path

    def are(expected: Any) -> Callable[[tuple[Array, list[str]]], str]:
        return lambda found: (
            "" if np.array_equal(found[0], np.asarray(expected, float)) else f"{found[0].tolist()}"
        )

    flipped = (np.array(placed) * [-1, -1, 1]).tolist()
    right = {
        "RAS": (write({"coordinateSystem": "RAS", "controlPoints": points()}), placed),
        "LPS": (write({"coordinateSystem": "LPS", "controlPoints": points()}), flipped),
        "no system: LPS": (write({"controlPoints": points()}), flipped),
        "system 0: RAS": (write({"coordinateSystem": 0, "controlPoints": points()}), placed),
        "system 1: LPS": (write({"coordinateSystem": 1, "controlPoints": points()}), flipped),
        "undefined, an old position": (
            write({"coordinateSystem": "RAS", "controlPoints": points({}, {"positionStatus": "undefined"})}),
            [placed[0], placed[2]],
        ),
        "undefined, no position": (
            write(
                {
                    "coordinateSystem": "RAS",
                    "controlPoints": points({"position": "", "positionStatus": "undefined"}),
                }
            ),
            placed[1:],
        ),
        "preview": (
            write({"coordinateSystem": "RAS", "controlPoints": points({"positionStatus": "preview"})}),
            placed[1:],
        ),
        "two markups of two systems": (
            write({"coordinateSystem": "RAS", "controlPoints": points()}, {"controlPoints": points()}),
            placed + flipped,
        ),
    }
    found = [
        read_right("marks", d, partial(read_markers, path), are(known)) for d, (path, known) in right.items()
    ]
    wrong: dict[str, tuple[dict[str, Any], str]] = {
        "NaN": ({"controlPoints": points({"position": [1, 2, float("nan")]})}, "finite"),
        "none placed": (
            {"controlPoints": points(*[{"positionStatus": "undefined"}] * 3)},
            "none of 3 is placed",
        ),
        "metres": ({"coordinateUnits": "m", "controlPoints": points()}, "not mm"),
        "unknown system": ({"coordinateSystem": "XYZ", "controlPoints": points()}, "XYZ"),
        "a region of interest": ({"type": "ROI", "controlPoints": points()}, "ROI"),
        "points that are no points": ({"controlPoints": ["F-1"]}, "list of points"),
        "unknown status": ({"controlPoints": points({"positionStatus": "maybe"})}, "maybe"),
    }
    for defect, (markup, reason) in wrong.items():
        found.append(refused("marks", "", defect, partial(read_markers, write(markup)), reason))
    twice = write({"controlPoints": points({"label": "a"}, {"label": "a"})})
    found.append(refused("landmarks", "", "a label twice", lambda: read_landmarks(twice), "stands twice"))
    return found


def _attachments(folder: Path) -> list[Row]:
    mesh = ball()
    template = Surface(mesh.vertices, mesh.faces)
    path = folder / "attachments.json"

    def read(text: str) -> Callable[[], Any]:
        def run() -> Any:
            path.write_text(text)
            return read_attachments(path, template)

        return run

    found = [
        read_right(
            "attachments",
            "JSON",
            read('{"near": [3, 1, 2]}'),
            lambda a: "" if a["near"].tolist() == [1, 2, 3] else "others",
        ),
        refused(
            "attachments", "JSON", "beyond the vertices", read('{"near": [1, 642]}'), "ids outside 0..641"
        ),
        refused("attachments", "JSON", "fractions", read('{"near": [1.5]}'), "no list of whole numbers"),
        refused("attachments", "JSON", "a bone twice", read('{"near": [1], "near": [2]}'), "stands twice"),
        refused("attachments", "JSON", "a list", read("[1, 2]"), "cannot be read"),
    ]
    bone = {"near": template.moved(template.vertices + [2 * RADIUS, 0, 0])}
    ids = {"near": np.argsort(-template.vertices[:, 0])[:10]}
    small = template.moved(template.vertices / 10)
    found += [
        read_right(
            "template", "at its bone", lambda: require_near_bones("t", template, ids, bone), lambda _: ""
        ),
        refused(
            "template",
            "centimetres",
            "not mm",
            lambda: require_near_bones("t", small, ids, bone),
            "centimetres",
        ),
    ]
    return found
