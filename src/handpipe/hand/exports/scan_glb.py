"""The scan of the skin, with its texture, as it moves with simulated frames: an animated glTF."""

from __future__ import annotations

import io
import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pygltflib as gltf
from PIL import Image
from scipy.spatial import cKDTree

from handpipe.core import Array, InputError, IntArray, Shape, atomic
from handpipe.hand.exports.carried_scan import FARTHEST, CarriedScan
from handpipe.hand.exports.export import GAMMA, ROUGHNESS, GlbWriter, Normals, numbers_within, write_empty
from handpipe.hand.exports.textured_scan import ScanPart
from handpipe.hand.simulation import SimulatedFrame
from handpipe.mesh.surfaces import Surface

log = logging.getLogger(__name__)

SAME = 1e-4  # mm between two readings of one vertex
WHITE = 255.0  # of a colour in bytes
LAYER, SKIN = "scan", "skin"
Finish = Callable[[Surface, Array], Array]  # from the skin at rest and (k, 3) in a frame to (k, 3)


def placed_parts(
    parts: Sequence[ScanPart], scan: Surface, aligned: Surface, source: str | Path
) -> list[ScanPart]:
    """Parts of a scan where its alignment to the image puts them.

    Triangles that the alignment left out, such as dust, are left out here, too.

    Parameters
    ----------
    parts : sequence of ScanPart
        What the scan's file has.
    scan : Surface
        The same scan as it was aligned.
    aligned : Surface
        The same vertices after alignment.
    source : path
        The scan's file.

    Returns
    -------
    list of ScanPart
        Parts with their vertices moved.

    Raises
    ------
    InputError
        Where the two surfaces have different numbers of vertices, or no vertex of a part is found.
    """
    if len(scan.vertices) != len(aligned.vertices):
        problem = f"has {len(scan.vertices)} vertices, but its alignment has {len(aligned.vertices)}"
        raise InputError(source, "scan", problem, "Build the alignment again")
    tree, found = cKDTree(scan.vertices), list[ScanPart]()
    for part in parts:
        gaps, nearest = tree.query(part.vertices)
        kept = (gaps <= SAME)[part.triangles].all(axis=1)
        if kept.any():
            found.append(replace(part, vertices=aligned.vertices[nearest], triangles=part.triangles[kept]))
    if not found:
        raise InputError(source, "scan", "no vertex is where it was aligned", "Build the alignment again")
    return found


def write_scan_glb(
    path: str | Path,
    parts: Sequence[ScanPart],
    frames: Sequence[SimulatedFrame],
    fps: float = 24.0,
    finish: Finish | None = None,
) -> int:
    """Write a scan that the skin of frames carries as one animated glTF binary, metres, y up.

    Meshes, morph targets and times are as `write_glb` has them. Images and texture coordinates, or colours of
    vertices, are the scan's. Triangles with a vertex far from the skin are left out: they are of what is not
    modelled.

    Parameters
    ----------
    path : path
        File to be written. Without frames it is an empty scene.
    parts : sequence of ScanPart
        The neutral scan, in mm.
    frames : sequence of SimulatedFrame
        Frames in the order of time, with a body "skin".
    fps : float
        Frames per second.
    finish : callable, optional
        What is done to the skin of a frame before it carries the scan.

    Returns
    -------
    int
        Number of triangles left out.

    Raises
    ------
    InputError
        Where no part of the scan is near the skin.
    """
    if not frames:
        write_empty(path)
        return 0
    shape = _skin(frames[0])
    skin = Surface(shape.rest, shape.cells)
    carrier = CarriedScan.attach(np.concatenate([part.vertices for part in parts]), skin)
    ends = np.cumsum([len(part.vertices) for part in parts])[:-1]
    near_skin = np.split(carrier.beside, ends)
    beside = [near[part.triangles].all(axis=1) for part, near in zip(parts, near_skin, strict=True)]
    if not any(near.any() for near in beside):
        problem = "no triangle of the scan is near the simulated skin"
        raise InputError(path, "scan", problem, "Give the scan of this subject's neutral pose")
    chosen = numbers_within(len(frames), len(carrier.offsets))
    names, moved = list[str](), list[list[Array]]()
    for frame in (frames[number] for number in chosen):  # one in memory at a time, but for its scan
        vertices = _skin(frame).vertices
        names.append(frame[0].name)
        moved.append(np.split(carrier(vertices if finish is None else finish(skin, vertices)), ends))
    writer = _ScanWriter(names, np.array(chosen) / fps, "LINEAR")
    for number, (part, near) in enumerate(zip(parts, beside, strict=True)):
        if not near.any():
            continue
        writer.part = part
        cells = part.triangles[near]
        shapes = {i: Shape(part.vertices, x[number], cells) for i, x in enumerate(moved)}
        writer.add(LAYER, str(number), shapes)
    with atomic(path) as temporary:
        writer.finish().save_binary(str(temporary))
    left_out = sum(int((~near).sum()) for near in beside)
    text = "the skin carries %d triangles of the scan; %d more than %g mm from it at rest are left out"
    log.info(text, sum(len(p.triangles) for p in parts) - left_out, left_out, FARTHEST)
    return left_out


def _skin(frame: SimulatedFrame) -> Shape:
    """The skin among a frame's bodies."""
    return next(shapes[SKIN] for shapes in frame[1].values() if SKIN in shapes)


class _ScanWriter(GlbWriter):
    """A glTF writer whose bodies look as the `part` of a scan that they are."""

    part: ScanPart

    def normals(self, rest: Surface) -> Normals:
        """As of any body; vertices at one place, on both sides of a seam of texture, have one normal."""
        _, first, same = np.unique(rest.vertices, axis=0, return_index=True, return_inverse=True)
        same = same.ravel()
        welded = Surface(rest.vertices[first], same[rest.triangles])
        return lambda vertices: np.asarray(welded.moved(vertices[first]).vertex_normals()[same])

    def colour(self, primitive: gltf.Primitive, look: str, shape: Shape, used: IntArray) -> None:
        """Give a primitive, made of some vertices of the part, its image or its colours."""
        part = self.part
        if part.image is not None and part.places is not None:
            places = part.places[used] * [1.0, -1.0] + [0.0, 1.0]  # glTF counts from the upper left
            primitive.attributes.TEXCOORD_0 = self.accessor(places.astype(np.float32), gltf.ARRAY_BUFFER)
            primitive.material = self._textured(part.image)
        elif part.colours is not None:
            linear = ((part.colours[used] / WHITE) ** GAMMA).astype(np.float32)
            primitive.attributes.COLOR_0 = self.accessor(linear, gltf.ARRAY_BUFFER)
            primitive.material = self.material(SKIN, white=True)
        else:
            primitive.material = self.material(SKIN)

    def _textured(self, image: Image.Image) -> int:
        """A material that shows an image."""
        document = self.document
        kind = "jpeg" if image.format == "JPEG" else "png"
        content = io.BytesIO()
        if kind == "jpeg":
            image.save(content, "JPEG", quality="keep")
        else:
            image.save(content, "PNG")
        view = gltf.BufferView(buffer=0, byteOffset=len(self.blob), byteLength=len(content.getvalue()))
        self.blob += content.getvalue()
        self.blob += bytes(-len(self.blob) % 4)  # what follows begins at a multiple of four
        document.bufferViews.append(view)
        document.images.append(gltf.Image(bufferView=len(document.bufferViews) - 1, mimeType=f"image/{kind}"))
        document.textures.append(gltf.Texture(source=len(document.images) - 1))
        shown = gltf.TextureInfo(index=len(document.textures) - 1)
        surface = gltf.PbrMetallicRoughness(
            baseColorTexture=shown, metallicFactor=0.0, roughnessFactor=ROUGHNESS
        )
        document.materials.append(gltf.Material(pbrMetallicRoughness=surface, doubleSided=True))
        return len(document.materials) - 1
