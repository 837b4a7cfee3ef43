"""Views of simulated frames for other programs: VTU with .pvd (ParaView), OBJ sequence, animated glTF.

VTU holds every body; OBJ and glTF, which are for viewing, leave out the fat's tetrahedra where there is a
skin.
"""

from __future__ import annotations

import csv
import io
import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
import pygltflib as gltf
from numpy.typing import NDArray

from handpipe.core import LAYERS, Array, IntArray, Shape, atomic, evenly, write_text
from handpipe.fem.elements import plasticity
from handpipe.hand.appearance import colour, opacity, shown, tissue, vertex_colours
from handpipe.hand.simulation import SimulatedFrame
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import TetMesh

log = logging.getLogger(__name__)

PLASTIC = "strain"  # field of tets: six numbers of their plastic deformation F_p
CELL_TYPES = {2: "line", 3: "triangle", 4: "tetra"}
ASSET = gltf.Asset(version="2.0", generator="handpipe")
COMPONENTS = {"float32": gltf.FLOAT, "uint32": gltf.UNSIGNED_INT, "uint16": gltf.UNSIGNED_SHORT}
ELEMENTS = {1: gltf.SCALAR, 2: gltf.VEC2, 3: gltf.VEC3, 4: gltf.VEC4, 16: gltf.MAT4}
LARGEST = 800_000_000  # bytes of one glTF's moving vertices: its format ends at 4 GiB, viewers before
BYTES_A_VERTEX = 24  # and frame: a place and a normal in single precision
ROUGHNESS = 0.6  # of all materials: between a mirror and chalk
GAMMA = 2.2  # of sRGB: colours of glTF are linear light
Normals = Callable[[Array], Array]  # from vertices (n, 3) in mm to unit normals (n, 3)
TO_GLTF = 1e-3 * np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # mm to m, z up to y up


def surface_triangles(cells: IntArray) -> IntArray:
    """Cells to be drawn: the outward boundary of tetrahedra, or the cells themselves.

    Parameters
    ----------
    cells : array (m, 4), (m, 3) or (m, 2)
        Vertex indices of tetrahedra, triangles or segments.

    Returns
    -------
    array (k, 3) or (k, 2)
        Vertex indices of triangles or segments.
    """
    if cells.shape[1] == 4:
        return TetMesh(np.zeros((0, 3)), cells).boundary_faces()[0]
    return cells


def write_vtu_series(folder: str | Path, frames: Sequence[SimulatedFrame], fps: float = 24.0) -> list[Path]:
    """Write `{layer}.pvd` per layer and `{layer}/{body}-{frame number}.vtu` in mm.

    Each file carries the shape's fields over points or cells, the points' displacement from rest (mm) and the
    cells' `layer` (its number in `layer_registry.LAYERS`). The field "strain" of tets is written as
    `plastic_deformation`, all nine components of F_p row by row. The .pvd gives time in s and a part for each
    body, `frames.csv` each number's frame.

    Parameters
    ----------
    folder : path
        Folder that gets the files.
    frames : sequence of SimulatedFrame
        Frames in the order of time.
    fps : float
        Frames per second.

    Returns
    -------
    list of Path
        The .pvd files.
    """
    folder, names = Path(folder), []
    series: dict[str, list[dict[str, str]]] = {}
    for number, (frame, layers) in enumerate(frames):
        names.append(frame.name)
        for layer, shapes in layers.items():
            for part, (body, shape) in enumerate(shapes.items()):
                file = f"{layer}/{body}-{number:04d}.vtu"
                with atomic(folder / file) as temporary:
                    _vtu(layer, shape).write(temporary)
                series.setdefault(layer, []).append(
                    {"timestep": f"{number / fps:.6g}", "part": str(part), "name": body, "file": file}
                )
    write_numbers(folder, names)
    return [_write_pvd(folder / f"{layer}.pvd", entries) for layer, entries in series.items()]


def _vtu(layer: str, shape: Shape) -> meshio.Mesh:
    number = list(LAYERS).index(layer) if layer in LAYERS else len(LAYERS)
    point_data: dict[str, Any] = {"displacement": shape.vertices - shape.rest}
    cell_data: dict[str, Any] = {"layer": [np.full(len(shape.cells), number, dtype=np.int32)]}
    for name, values in shape.fields.items():
        if name == PLASTIC:
            name, values = "plastic_deformation", plasticity.to_matrices(values).reshape(-1, 9)
        if len(values) == len(shape.vertices):
            point_data[name] = values
        elif len(values) == len(shape.cells):
            cell_data[name] = [values]
    cells = [(CELL_TYPES[shape.cells.shape[1]], shape.cells)]
    return meshio.Mesh(shape.vertices, cells, point_data=point_data, cell_data=cell_data)


def _write_pvd(path: Path, entries: Sequence[Mapping[str, str]]) -> Path:
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    collection = ElementTree.SubElement(root, "Collection")
    for entry in entries:
        ElementTree.SubElement(collection, "DataSet", {"group": "", **entry})
    with atomic(path) as temporary:
        ElementTree.ElementTree(root).write(temporary, xml_declaration=True, encoding="utf-8")
    return path


def write_obj_sequence(folder: str | Path, frames: Sequence[SimulatedFrame]) -> list[Path]:
    """Write `frame-{number}.obj` in mm, one group `{layer}_{body}` per body.

    `frames.csv` gives each number's frame, whose name may hold what a file's name may not.

    Parameters
    ----------
    folder : path
        Folder that gets the files.
    frames : sequence of SimulatedFrame
        Frames in the order of time.

    Returns
    -------
    list of Path
        The .obj files.
    """
    paths, names = [], []
    for number, (frame, layers) in enumerate(frames):
        names.append(frame.name)
        path = Path(folder) / f"frame-{number:04d}.obj"
        with atomic(path) as temporary, open(temporary, "w", encoding="utf-8") as file:
            first = 1
            for layer, body, shape in shown(layers):
                file.write(f"g {layer}_{body}\n")
                np.savetxt(file, shape.vertices, "v %.6f %.6f %.6f")
                cells = surface_triangles(shape.cells) + first
                np.savetxt(file, cells, "l %d %d" if cells.shape[1] == 2 else "f %d %d %d")
                first += len(shape.vertices)
        paths.append(path)
    write_numbers(Path(folder), names)
    return paths


def write_numbers(folder: Path, frames: Sequence[str]) -> None:
    """Write `frames.csv`: the number in the names of a series' files, and the frame.

    Parameters
    ----------
    folder : Path
        Folder of the series.
    frames : sequence of str
        Names of the frames in the order of time.
    """
    text = io.StringIO()
    rows = ((f"{number:04d}", name) for number, name in enumerate(frames))
    csv.writer(text, lineterminator="\n").writerows([("number", "frame"), *rows])
    write_text(folder / "frames.csv", text.getvalue())


def write_glb(
    path: str | Path, frames: Sequence[SimulatedFrame], fps: float = 24.0, *, step: bool = False
) -> None:
    """Write all frames as one animated glTF binary, metres, y up; neutral +z becomes +y.

    One mesh per body: surface triangles (of tetrahedra: their boundary) or lines in neutral, one morph target
    per frame, and weights that show frame i at i / fps seconds. Bodies absent from a frame are neutral there.
    Linear blending is for viewing: shapes between frames are not simulated. Of a scene whose frames would
    take more than 800 MB, frames in equal steps are written, the first and the last among them, at their
    times; the log says so.

    Parameters
    ----------
    path : path
        File to be written. Without frames it is an empty scene.
    frames : sequence of SimulatedFrame
        Frames in the order of time.
    fps : float
        Frames per second.
    step : bool
        Whether each frame stays until the next one; else shapes are blended linearly.
    """
    if not frames:
        write_empty(path)
        return
    chosen = numbers_in_glb(frames)
    names: list[str] = []
    bodies: dict[tuple[str, str], dict[int, Shape]] = {}
    for place, number in enumerate(chosen):
        frame, layers = frames[number]
        names.append(frame.name)
        for layer, body, shape in shown(layers):
            bodies.setdefault((layer, body), {})[place] = shape
    writer = GlbWriter(names, np.array(chosen) / fps, "STEP" if step else "LINEAR")
    for (layer, body), shapes_of_body in bodies.items():
        writer.add(layer, body, shapes_of_body)
    with atomic(path) as temporary:
        writer.finish().save_binary(str(temporary))


def numbers_in_glb(frames: Sequence[SimulatedFrame], size: int = LARGEST) -> list[int]:
    """Numbers of the frames that one glTF holds: all, or as many in equal steps as a size allows.

    Parameters
    ----------
    frames : sequence of SimulatedFrame
        Frames in the order of time, at least one.
    size : int
        Bytes of all moving vertices, at most, as far as two frames allow.
    """
    return numbers_within(len(frames), sum(len(shape.vertices) for _, _, shape in shown(frames[0][1])), size)


def numbers_within(count: int, vertices: int, size: int = LARGEST) -> list[int]:
    """As `numbers_in_glb`, of a number of frames in which so many vertices move."""
    chosen = evenly(count, max(size // max(vertices * BYTES_A_VERTEX, 1), 2))
    if len(chosen) < count:
        text = "a glTF of all %d frames would have %.1f GB; it has %d of them in equal steps, VTU has all"
        log.warning(text, count, 1e-9 * vertices * BYTES_A_VERTEX * count, len(chosen))
    return chosen.tolist()


def write_empty(path: str | Path) -> None:
    """Write a glTF binary with an empty scene: an accessor cannot be empty."""
    empty = gltf.GLTF2(asset=ASSET, scenes=[gltf.Scene(nodes=[])], scene=0)
    with atomic(path) as temporary:
        empty.save_binary(str(temporary))


class GlbWriter:
    """Collects meshes and their animation into one glTF with one buffer."""

    def __init__(self, names: Sequence[str], times: Array, interpolation: str) -> None:
        self.names, self.interpolation = list(names), interpolation
        self.document = gltf.GLTF2(asset=ASSET)
        self.document.scenes, self.document.scene = [gltf.Scene(nodes=[])], 0
        self.document.animations = [gltf.Animation(name="frames", channels=[], samplers=[])]
        self.blob = bytearray()
        self.materials: dict[tuple[str, bool], int] = {}
        count = len(names)
        self.times = self.accessor(times.astype(np.float32)[:, None], bounds=True)
        self.weights = self.accessor(np.eye(count, dtype=np.float32).reshape(-1, 1))

    def add(self, layer: str, body: str, shapes: Mapping[int, Shape]) -> None:
        """Add a body by its shape in each frame."""
        shape = next(iter(shapes.values()))
        cells = surface_triangles(shape.cells)
        used, local = np.unique(cells, return_inverse=True)
        local = local.reshape(cells.shape)
        rest = shape.rest[used]
        moved = [shapes[i].vertices[used] if i in shapes else rest for i in range(len(self.names))]
        primitive = gltf.Primitive(
            attributes=gltf.Attributes(POSITION=self.accessor(to_gltf(rest), gltf.ARRAY_BUFFER, bounds=True)),
            indices=self.accessor(local.reshape(-1, 1).astype(np.uint32), gltf.ELEMENT_ARRAY_BUFFER),
            mode=gltf.LINES if cells.shape[1] == 2 else gltf.TRIANGLES,
            targets=[{"POSITION": self.accessor(to_gltf(x - rest), bounds=True)} for x in moved],
        )
        self.colour(primitive, tissue(layer, body), shape, used)
        if cells.shape[1] == 3:
            normals_at = self.normals(Surface(rest, local))
            normals = to_gltf(1e3 * normals_at(rest))
            primitive.attributes.NORMAL = self.accessor(normals, gltf.ARRAY_BUFFER)
            for target, x in zip(primitive.targets, moved, strict=True):
                target["NORMAL"] = self.accessor(to_gltf(1e3 * normals_at(x)) - normals)
        self._mesh(f"{layer}/{body}", primitive)

    def normals(self, rest: Surface) -> Normals:
        """The function that gives the unit normals of a body, whose surface at rest is given, in a frame."""
        return lambda vertices: rest.moved(vertices).vertex_normals()

    def _mesh(self, name: str, primitive: gltf.Primitive) -> None:
        document, node = self.document, len(self.document.nodes)
        extras = {"targetNames": self.names}
        weights = [0.0] * len(self.names)
        document.meshes.append(gltf.Mesh(name=name, primitives=[primitive], weights=weights, extras=extras))
        document.nodes.append(gltf.Node(name=name, mesh=len(document.meshes) - 1))
        document.scenes[0].nodes.append(node)
        animation = document.animations[0]
        sampler = gltf.AnimationSampler(
            input=self.times, output=self.weights, interpolation=self.interpolation
        )
        animation.samplers.append(sampler)
        target = gltf.AnimationChannelTarget(node=node, path="weights")
        animation.channels.append(gltf.AnimationChannel(sampler=len(animation.samplers) - 1, target=target))

    def finish(self) -> gltf.GLTF2:
        """The document with its buffer."""
        self.document.buffers = [gltf.Buffer(byteLength=len(self.blob))]
        self.document.set_binary_blob(bytes(self.blob))
        return self.document

    def colour(self, primitive: gltf.Primitive, look: str, shape: Shape, used: IntArray) -> None:
        """Colour a primitive, made of some vertices of a body, as its tissue or as its vertices."""
        colours = vertex_colours(look, shape)
        primitive.material = self.material(look, white=colours is not None)
        if colours is not None:
            linear = (colours[used] ** GAMMA).astype(np.float32)
            primitive.attributes.COLOR_0 = self.accessor(linear, gltf.ARRAY_BUFFER)

    def material(self, look: str, *, white: bool = False) -> int:
        """The material of a tissue, made once; white under the colours of vertices, which multiply it."""
        if (look, white) not in self.materials:
            linear = [1.0] * 3 if white else [c**GAMMA for c in colour(look)]
            surface = gltf.PbrMetallicRoughness(
                baseColorFactor=[*linear, opacity(look)], metallicFactor=0.0, roughnessFactor=ROUGHNESS
            )
            material = gltf.Material(name=look, pbrMetallicRoughness=surface, doubleSided=True)
            material.alphaMode = gltf.BLEND if opacity(look) < 1 else gltf.OPAQUE
            self.materials[look, white] = len(self.document.materials)
            self.document.materials.append(material)
        return self.materials[look, white]

    def accessor(self, values: NDArray, target: int | None = None, *, bounds: bool = False) -> int:
        """Append an array (n, 1, 2, 3, 4 or 16) of float32, uint32 or uint16; return its accessor."""
        view = gltf.BufferView(buffer=0, byteOffset=len(self.blob), byteLength=values.nbytes, target=target)
        self.blob += np.ascontiguousarray(values).tobytes()
        self.document.bufferViews.append(view)
        accessor = gltf.Accessor(
            bufferView=len(self.document.bufferViews) - 1,
            componentType=COMPONENTS[values.dtype.name],
            count=len(values),
            type=ELEMENTS[values.shape[1]],
        )
        if bounds:
            accessor.min, accessor.max = values.min(axis=0).tolist(), values.max(axis=0).tolist()
        self.document.accessors.append(accessor)
        return len(self.document.accessors) - 1


def to_gltf(vectors: Array) -> NDArray[np.float32]:
    """Vectors (n, 3) in mm, z up, as glTF has them: float32 in m, y up."""
    return (vectors @ TO_GLTF.T).astype(np.float32)
