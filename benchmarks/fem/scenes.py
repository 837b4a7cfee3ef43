"""Bodies, bad starts and prescribed motions of the hard cases."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import skfem
import trimesh
from scipy.optimize import brentq
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from handpipe.core import Array, BoolArray, IntArray
from handpipe.fem.elements import Material, piola_stresses, plasticity
from handpipe.mesh.tets import TetMesh

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Body:
    """Rest vertices (n, 3) in mm, tets (m, 4) of positive volume, and outward boundary triangles (k, 3)."""

    vertices: Array
    tets: IntArray
    triangles: IntArray

    @staticmethod
    def of_tets(vertices: Array, tets: IntArray) -> Body:
        """Vertices that no tet uses are dropped; the order of a tet's corners is made positive."""
        used, corners = np.unique(tets, return_inverse=True)
        x, t = vertices[used], corners.reshape(tets.shape).astype(np.int64)
        negative = TetMesh(x, t).volumes() < 0
        t[negative] = t[negative][:, [0, 1, 3, 2]]
        return Body(x, t, TetMesh(x, t).boundary_faces()[0])

    def moved(self, vertices: Array) -> Body:
        """The same tets with other rest vertices."""
        return Body(vertices, self.tets, self.triangles)

    def where(self, axis: int, value: float) -> BoolArray:
        """Vertices (n,) on a plane across an axis."""
        return np.abs(self.vertices[:, axis] - value) < 1e-9

    def share(self) -> float:
        """Mean volume of a vertex in mm^3."""
        return float(TetMesh(self.vertices, self.tets).volumes().sum() / len(self.vertices))


def grid(*axes: Array) -> Body:
    """A box of cells of six tets each, between the ascending coordinates of three axes."""
    mesh = skfem.MeshTet.init_tensor(*axes)
    return Body.of_tets(mesh.p.T.copy(), mesh.t.T.astype(np.int64))


def box(size: Triple, cells: tuple[int, int, int]) -> Body:
    """A box about the origin. Its mesh is unchanged by a point reflection and by exchanging y and z."""
    return grid(*(np.linspace(-s / 2, s / 2, c + 1) for s, c in zip(size, cells, strict=True)))


def mirrored_in_y(half: Body) -> Body:
    """A body that lies at y >= 0, together with its mirror image; vertices on the plane y = 0 are shared."""
    count = len(half.vertices)
    image = np.arange(count)
    off = ~half.where(1, 0.0)
    image[off] = count + np.arange(off.sum())
    vertices = np.concatenate([half.vertices, half.vertices[off] * [1.0, -1.0, 1.0]])
    return Body.of_tets(vertices, np.concatenate([half.tets, image[half.tets]]))


def mirror_images(vertices: Array, matrix: Array) -> IntArray:
    """For each vertex (n, 3) the one at its image under a symmetry (3, 3) of the mesh."""
    distances, indices = cKDTree(vertices).query(vertices @ matrix.T)
    if distances.max() > 1e-9:
        raise ValueError("the mesh does not have this symmetry")
    return indices


def asymmetry(x: Array, rest: Array, matrix: Array) -> float:
    """Largest distance in mm between shape x (n, 3) and its image under a symmetry (3, 3) of the scene."""
    return float(np.linalg.norm(x[mirror_images(rest, matrix)] - x @ matrix.T, axis=1).max())


def without(body: Body, vertices: BoolArray) -> Body:
    """The body without the tets all of whose corners are in a mask (n,)."""
    return Body.of_tets(body.vertices, body.tets[~vertices[body.tets].all(axis=1)])


def u_shape(refine: int) -> Body:
    """Two arms along x above and below a slit, joined at x = 0; mirrored in the plane y = 0."""
    step = 0.25 / refine
    x, y = np.arange(0.0, 4.0 + step / 2, step), np.arange(0.0, 1.0 + step / 2, step)
    z = np.arange(-0.75, 0.75 + step / 2, step)
    half = grid(x, y, z)
    centres = half.vertices[half.tets].mean(axis=1)
    slit = (centres[:, 0] > 1.0) & (centres[:, 1] < 0.25)
    return mirrored_in_y(Body.of_tets(half.vertices, half.tets[~slit]))


def sphere(radius: float, centre: Triple, subdivisions: int) -> tuple[Array, IntArray]:
    """Vertices (k, 3) and outward triangles of a sphere."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return np.array(mesh.vertices) + centre, np.array(mesh.faces, dtype=np.int64)


def rotation(axis: Triple, degrees: float) -> Array:
    """Rotation matrix (3, 3) about an axis."""
    return Rotation.from_rotvec(np.radians(degrees) * np.array(axis) / np.linalg.norm(axis)).as_matrix()


def turned(
    x: Array, part: BoolArray, axis: Triple, degrees: float, centre: Triple = (0.0, 0.0, 0.0)
) -> Array:
    """Vertices (n, 3) of which a part (n,) is turned about a centre."""
    out = x.copy()
    out[part] = (x[part] - centre) @ rotation(axis, degrees).T + centre
    return out


# Bad starts


def scrambled(rest: Array, seed: int = 0) -> Array:
    """Every vertex at a random place in the bounding box."""
    return np.random.default_rng(seed).uniform(rest.min(axis=0), rest.max(axis=0), rest.shape)


def onto_plane(rest: Array) -> Array:
    """Every vertex on a slanting plane through the centre."""
    normal = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    return rest - np.outer((rest - rest.mean(axis=0)) @ normal, normal)


def onto_point(rest: Array) -> Array:
    """Every vertex at the centre."""
    return np.tile(rest.mean(axis=0), (len(rest), 1))


def mirrored(rest: Array) -> Array:
    """The mirror image in the plane x = min x: every tet is inverted, at no strain but that."""
    low = rest[:, 0].min()
    return rest * [-1.0, 1.0, 1.0] + [2 * low, 0.0, 0.0]


def inside_out(rest: Array) -> Array:
    """Along each ray from the centre, what was at a share s of the way to the boundary comes to 1 - 0.8 s."""
    centre = rest.mean(axis=0)
    half = np.ptp(rest, axis=0) / 2
    offset = rest - centre
    share = np.abs(offset / half).max(axis=1, keepdims=True)
    direction = np.where(share > 1e-9, offset / np.maximum(share, 1e-9), [half[0], 0.0, 0.0])
    return centre + (1.0 - 0.8 * share) * direction


# Badly shaped and badly matched elements


def with_slivers(body: Body, height: float, share: float, seed: int = 0) -> Body:
    """The body with some interior vertices moved to `height` times their distance from a face opposite."""
    rng = np.random.default_rng(seed)
    x = body.vertices.copy()
    interior = np.setdiff1d(np.arange(len(x)), np.unique(body.triangles))
    blocked = np.zeros(len(x), dtype=bool)
    for vertex in rng.permutation(interior)[: max(1, int(share * len(interior)))]:
        around = body.tets[(body.tets == vertex).any(axis=1)]
        if blocked[around].any():
            continue
        tet = around[rng.integers(len(around))]
        face = x[tet[tet != vertex]]
        x[vertex] = face.mean(axis=0) + height * (x[vertex] - face.mean(axis=0))
        blocked[around] = True
    return body.moved(x)


def random_strains(count: int, low: float, high: float, seed: int = 0) -> Array:
    """Symmetric strains (m, 6) with log-uniform eigenvalues in random frames, independent from tet to tet."""
    rng = np.random.default_rng(seed)
    values = np.exp(rng.uniform(np.log(low), np.log(high), (count, 3)))
    values[0], values[1] = (low, high, low), (high, low, high)
    frames = Rotation.random(count, rng=rng).as_matrix()
    return plasticity.from_matrices(np.einsum("mij,mj,mkj->mik", frames, values, frames))


def square_roots(matrices: Array) -> Array:
    """Square roots of symmetric positive matrices (m, 3, 3)."""
    values, vectors = np.linalg.eigh(matrices)
    return np.einsum("mij,mj,mkj->mik", vectors, np.sqrt(values), vectors)


def grown(body: Body) -> Array:
    """A shape (n, 3) of the body, clamped at its lowest x, with stretches from 0.05 to 4 along x and back.

    Lengths along x are scaled layer by layer, y and z by a smooth function of x; a shear wave bends it.
    """
    x = body.vertices
    low, high = x[:, 0].min(), x[:, 0].max()
    levels = np.unique(x[:, 0])
    factors = np.resize([1.0, 4.0, 0.05, 2.0, 0.4, 3.0], len(levels) - 1)
    heights = low + np.concatenate([[0.0], np.cumsum(factors * np.diff(levels))])
    along = np.interp(x[:, 0], levels, heights)
    share = (x[:, 0] - low) / (high - low)
    waist = 1.0 - 0.6 * np.sin(np.pi * share) ** 2
    wave = 0.3 * np.sin(2 * np.pi * share)
    return np.column_stack([along, x[:, 1] * waist + wave, x[:, 2] * waist])


# Known answers


def lateral_stretch(material: Material, stretch: float) -> float:
    """Lateral stretch of a bar with free sides."""

    def pressure(lateral: float) -> float:
        return stress(material, (stretch, lateral, lateral))[1]

    return float(brentq(pressure, 0.2, 3.0, xtol=1e-14))


def stress(material: Material, stretches: Triple) -> Array:
    """First Piola stresses (3,) in kPa along the axes of a pure stretch."""
    mu, lam = material.lame(1)
    return np.diag(piola_stresses(0, np.diag(stretches)[None], mu, lam)[0]).copy()


def uniaxial(material: Material, traction: float) -> Array:
    """Stretches (3,) of a bar with free sides under a nominal traction in kPa along x."""

    def excess(stretch: float) -> float:
        lateral = lateral_stretch(material, stretch)
        return stress(material, (stretch, lateral, lateral))[0] - traction

    stretch = float(brentq(excess, 0.5, 5.0, xtol=1e-14))
    lateral = lateral_stretch(material, stretch)
    return np.array([stretch, lateral, lateral])
