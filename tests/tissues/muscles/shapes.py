"""Bodies of known shape that the tests of muscles share."""

import numpy as np
import trimesh
from scipy import sparse

from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.tissues.muscles.fitting.soft_body import SoftBody


def box(cells=(6, 2, 2), size=(12.0, 4.0, 4.0)) -> TetMesh:
    """Tets of a regular grid, six a cell around the diagonal."""
    nx, ny, nz = cells
    grid = np.stack(np.meshgrid(*(np.arange(c + 1) for c in cells), indexing="ij"), axis=-1)
    vertices = grid.reshape(-1, 3) * np.array(size) / cells
    index = np.arange(len(vertices)).reshape(nx + 1, ny + 1, nz + 1)
    tets = []
    for path in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)):
        at = np.zeros(3, int)
        corners = [index[:nx, :ny, :nz].ravel()]
        for axis in path:
            at[axis] += 1
            corners.append(index[at[0] : nx + at[0], at[1] : ny + at[1], at[2] : nz + at[2]].ravel())
        tets.append(np.column_stack(corners))
    mesh = TetMesh(vertices, np.concatenate(tets))
    flipped = mesh.volumes() < 0
    mesh.tets[flipped] = mesh.tets[flipped][:, [0, 2, 1, 3]]
    return mesh


def flesh_about(cells) -> TetMesh:
    """A block of flesh from end to end of the spindle at rest and about it."""
    block = box(cells, (48.0, 16.0, 16.0))
    return block.moved(block.vertices - [24.0, 8.0, 8.0])


def bent(x: np.ndarray, angle: float, thickening: float = 0.0) -> np.ndarray:
    """A beam along x bent by an angle over its length, and thickened in its middle."""
    length = x[:, 0].max()
    t = x[:, 0] / length
    scale = 1 + thickening * np.sin(np.pi * t)
    y, z = scale * (x[:, 1] - 2), scale * (x[:, 2] - 2)
    radius = length / angle if angle else np.inf
    if angle == 0:
        return np.column_stack([x[:, 0], y, z])
    phi = angle * t
    return np.column_stack([(radius + z) * np.sin(phi), y, (radius + z) * np.cos(phi) - radius])


def surface_of(mesh: TetMesh) -> sparse.csr_matrix:
    ids = mesh.boundary_vertices()
    return sparse.csr_matrix(
        (np.ones(len(ids)), (np.arange(len(ids)), ids)), shape=(len(ids), len(mesh.vertices))
    )


def rod(centre, length: float, radius: float, across: float | None = None) -> Surface:
    """An ellipsoid along x."""
    sphere = trimesh.creation.icosphere(subdivisions=3)
    return Surface(sphere.vertices * [length / 2, radius, across or radius] + centre, sphere.faces)


def spindle(centre=(0.0, 0.0, 0.0), edge: float = 2.5) -> SoftBody:
    """A muscle from x = -15 to 15, held by bone "a" at its start and by bone "b" at its end."""
    surface = rod(np.asarray(centre, float), 30.0, 4.0, 3.0)
    x = surface.vertices[:, 0]
    return SoftBody.fill(surface, {"a": np.flatnonzero(x < -13), "b": np.flatnonzero(x > 13)}, edge)


def hinge(angle: float, z: float = -6.0) -> dict[str, RigidTransform]:
    """Bone "b" turned about the y axis through (0, 0, z), bone "a" at rest."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return {"a": RigidTransform.identity(), "b": RigidTransform.about(np.array([0, 0, z]), turn)}


def hinge_bones() -> dict[str, Surface]:
    """Two rods below the spindle that meet at the hinge."""
    return {"a": rod([-11.0, 0.0, -7.0], 21.0, 2.0), "b": rod([11.0, 0.0, -7.0], 21.0, 2.0)}


def hairpin(radius: float, subdivisions: int = 4) -> tuple[Surface, list[np.ndarray]]:
    """A flat muscle of 24 by 6 by 1.6 mm, bent back on itself over half a turn, and its four sides.

    Its legs lie along x, `2 radius - 1.6` mm apart. A side is an array of triangles, outer or inner ones of a
    leg; none of one side has a vertex of another.
    """
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    along, y, up = (ball.vertices * [12.0, 3.0, 0.8]).T
    angle = np.clip(along / radius, -np.pi / 2, np.pi / 2)
    leg = np.maximum(np.abs(along) - radius * np.pi / 2, 0.0)
    arc = np.column_stack([leg - (radius - up) * np.cos(angle), y, (radius - up) * np.sin(angle)])
    faces = ball.faces[:, ::-1]
    sides = []
    for leg_sign in (-1, 1):
        for up_sign in (-1, 1):
            of = (leg_sign * along > 2.0) & (up_sign * up > 0.05)
            sides.append(faces[of[faces].all(axis=1)])
    return Surface(arc, faces), sides
