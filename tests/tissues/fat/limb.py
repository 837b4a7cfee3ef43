"""A limb whose mechanics are plain: a capsule of soft tissue around a capsule of bone, both along x."""

from __future__ import annotations

from functools import cache

import numpy as np
import trimesh

from handpipe.core.layers import Region, Shape, Shapes
from handpipe.core.rigid import RigidTransform
from handpipe.mesh.generation.remeshing import remesh
from handpipe.mesh.surfaces.surface import Surface
from handpipe.tissues.fat.constraints import inner_points
from handpipe.tissues.fat.mesh import tissue_mesh
from handpipe.tissues.fat.skin import Rigid
from handpipe.tissues.fat.tissue import Tissue

LENGTH, CORE, SKIN = 12.0, 2.0, 6.0


def capsule(radius: float, edge: float, length: float = LENGTH) -> Surface:
    """A capsule about the origin: a cylinder of a length along x between two half spheres."""
    mesh = trimesh.creation.capsule(height=length, radius=radius, count=[24, 24])
    vertices = np.array(mesh.vertices)
    vertices[:, 2] -= vertices[:, 2].mean()
    return remesh(Surface(vertices[:, [2, 0, 1]], np.array(mesh.faces, dtype=np.int64)), edge)


def core_regions(kind: Region) -> np.ndarray:
    """The bone's regions (n,): of one kind all over, but fixed at its proximal end where it only touches."""
    core = capsule(CORE, 1.0)
    return np.full(len(core.vertices), kind)


def below(posed: np.ndarray | None = None, kind: Region = Region.fixed) -> dict[str, Shapes]:
    """The layers under the tissue: one bone, its vertices where `posed` says."""
    core = capsule(CORE, 1.0)
    vertices = core.vertices if posed is None else posed
    return {"bones": {"core": Shape(core.vertices, vertices, core.triangles, {"region": core_regions(kind)})}}


@cache
def limb(kind: Region = Region.fixed) -> Tissue:
    """The tissue, held by the bone in one way everywhere and rigid at the skin's proximal tip."""
    skin, core = capsule(SKIN, 2.0), capsule(CORE, 1.0)
    mesh, occupancy = tissue_mesh(skin, core, 2.5)
    inner = inner_points(below(kind=kind), ("bones",), core, 0.1)
    tip = Rigid("core", np.flatnonzero(skin.vertices[:, 0] < -9.0))
    return Tissue(mesh, occupancy, skin, inner, {"tip": tip}, ("core",), np.ones((len(mesh.vertices), 1)))


def at_rest() -> dict[str, RigidTransform]:
    """Transforms of the rigid parts, none moved."""
    return {"tip": RigidTransform.identity()}
