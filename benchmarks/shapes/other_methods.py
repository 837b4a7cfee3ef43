"""Other ways to carry a template to marks: as-rigid-as-possible, biharmonic, bounded biharmonic, bending,
coupled prisms, elastic, deformation transfer, incremental plasticity, non-rigid ICP.

All are given what `fit_organ` is given, marked points and their true places, at settings that were found to
suit them. Those on surfaces leave inner vertices where they were.
"""

from __future__ import annotations

import igl
import numpy as np
import trimesh

from benchmarks.shapes.bending import Bending
from benchmarks.shapes.comparison_bodies import Body
from benchmarks.shapes.primo import Prisms
from benchmarks.shapes.transfer import SmoothGradients
from handpipe.core import Array, ConvergenceError, IntArray
from handpipe.fem.contact import Attachment
from handpipe.fem.elements import Material
from handpipe.fem.potentials import Elastic, Potential
from handpipe.fem.solver import equilibrium
from handpipe.shapes.optimisation.settings import OrganSettings
from handpipe.shapes.organs import Observed, fit_organ

SETTINGS = OrganSettings(remesh_below=0.0)
YOUNG = 6.0  # kPa
COMPRESSIBLE = Material(YOUNG, 0.0)  # nearly incompressible tissue loses more of the growth
STEPS = 4  # of the springs to their targets
FIRM = 5e4  # mN/mm of springs against the stiff energy of deformation transfer
INCREMENTS = 20  # of incremental plasticity
BOUNDED = 20  # iterations of bounded biharmonic weights
HEIGHT = 10.0  # mm of coupled prisms: low ones lose more volume, higher ones cross the axes of the bodies
ROUNDS, SETTLED = 2000, 1e-5  # of as-rigid-as-possible; mm that a round still moves any vertex by


def plastic(body: Body) -> Array:
    """Ours."""
    attached, marked = body.pairs(body.attached), body.pairs(body.marked)
    observed = Observed(attachments=attached, landmarks=marked)
    return fit_organ(body.mesh, observed, settings=SETTINGS).mesh.vertices


def plastic_attached(body: Body) -> Array:
    """Ours with all points attached, as Wang 2021 attaches both ends (§5.4): strains are for what an elastic
    body under springs does not meet."""
    observed = Observed(attachments=body.pairs(_points(body)))
    return fit_organ(body.mesh, observed, settings=SETTINGS).mesh.vertices


def elastic(body: Body) -> Array:
    """The elastic equilibrium, springs at all points; they move to their targets bit by bit."""
    return _springs(body, [], STEPS, plastic=False, stiffness=SETTINGS.spring)


def elastic_incremental(body: Body) -> Array:
    """The same, but after each increment its shape becomes the shape at rest."""
    return _springs(body, [], INCREMENTS, plastic=True, stiffness=SETTINGS.spring)


def transfer(body: Body) -> Array:
    """Deformation transfer: neighbouring tets deform alike (Sumner and Popovic 2004); and elasticity."""
    smooth = SmoothGradients(body.mesh, YOUNG)
    return _springs(body, [smooth], STEPS, plastic=False, stiffness=FIRM)


def _springs(body: Body, others: list[Potential], steps: int, *, plastic: bool, stiffness: float) -> Array:
    """Equilibrium of the tissue, others and springs that move bit by bit."""
    x, points = body.mesh.vertices, _points(body)
    pairs = body.pairs(points)
    springs = Attachment(pairs.attached(body.mesh).matrix, pairs.points, stiffness)
    tissue = Elastic(x, body.mesh.tets, COMPRESSIBLE)
    options = equilibrium.Options(name="elastic", untangle=False)  # springs at points turn tets inside out
    for t in np.linspace(0.0, 1.0, steps + 1)[1:]:
        towards = pairs.points + t * (pairs.targets - pairs.points)
        x = equilibrium.solve([tissue, *others, springs.moved(towards)], x, options=options).x
        if plastic:
            inverted = int((body.mesh.moved(x).volumes() <= 0).sum())
            if inverted:
                reason = f"{inverted} inverted tets, {100 * t:.0f} % of the way"
                raise ConvergenceError("incremental plasticity", reason, "Give fewer marks or coarser tets")
            tissue = Elastic(x, body.mesh.tets, COMPRESSIBLE)
    return x


def arap_volume(body: Body) -> Array:
    """As-rigid-as-possible in every tet."""
    return _arap(body, body.mesh.tets)


def arap_surface(body: Body) -> Array:
    """As-rigid-as-possible on the surface (spokes and rims)."""
    return _arap(body, body.mesh.boundary_faces()[0])


def biharmonic_volume(body: Body) -> Array:
    """The biharmonic displacement in the volume."""
    return _biharmonic(body, body.mesh.tets)


def biharmonic_surface(body: Body) -> Array:
    """The biharmonic displacement on the surface."""
    return _biharmonic(body, body.mesh.boundary_faces()[0])


def biharmonic_linear(body: Body) -> Array:
    """Biharmonic coordinates of linear precision (Wang 2015; LBW in Wang 2021): affine maps are met
    exactly."""
    part = Part(body, body.mesh.tets)
    handles = [[int(point)] for point in part.points]
    return part.whole(igl.biharmonic_coordinates(part.x, part.cells, handles, 2) @ part.targets)


def bounded_biharmonic(body: Body) -> Array:
    """Moves blended by bounded biharmonic weights (Jacobson 2011), a handle a point."""
    part = Part(body, body.mesh.tets)
    each = np.eye(len(part.points))
    weights = igl.bbw(part.x, part.cells, part.points, each, partition_unity=False, max_iter=BOUNDED)
    weights /= weights.sum(axis=1, keepdims=True)
    return part.whole(part.x + weights @ (part.targets - part.x[part.points]))


def bending(body: Body) -> Array:
    """Least bending of the surface, a rotation a vertex (Wang 2021 Eq. 5.28), from the biharmonic shape."""
    part = Part(body, body.mesh.boundary_faces()[0])
    return part.whole(Bending(part.x, part.cells, part.points).least(_harmonic(part), part.targets))


def bending_incremental(body: Body) -> Array:
    """The same in increments, after each of which the surface rests where it is."""
    part = Part(body, body.mesh.boundary_faces()[0])
    x, begun = part.x, part.x[part.points]
    for t in np.linspace(0.0, 1.0, INCREMENTS + 1)[1:]:
        x = Bending(x, part.cells, part.points).least(x, begun + t * (part.targets - begun))
    return part.whole(x)


def primo(body: Body) -> Array:
    """Coupled prisms on the surface (Botsch 2006), from the biharmonic shape."""
    part = Part(body, body.mesh.boundary_faces()[0])
    prisms = Prisms(part.x, part.cells, part.points, HEIGHT)
    return part.whole(prisms.least(_harmonic(part), part.targets))


def _points(body: Body) -> IntArray:
    return np.concatenate([body.attached, body.marked])


class Part:
    """The vertices that some cells use, and the marked ones among them."""

    def __init__(self, body: Body, cells: IntArray) -> None:
        self.body = body
        self.used, found = np.unique(cells, return_inverse=True)
        self.cells = found.reshape(cells.shape).astype(np.int64)
        points = np.intersect1d(_points(body), self.used)
        self.points = np.searchsorted(self.used, points)
        self.x, self.targets = body.mesh.vertices[self.used], body.truth[points]

    def whole(self, x: Array) -> Array:
        """All vertices, those of the part at x."""
        found = self.body.mesh.vertices.copy()
        found[self.used] = x
        return found


def _harmonic(part: Part) -> Array:
    moves = part.targets - part.x[part.points]
    return part.x + igl.harmonic(part.x, part.cells, part.points, moves, 2)


def _biharmonic(body: Body, cells: IntArray) -> Array:
    part = Part(body, cells)
    return part.whole(_harmonic(part))


def _arap(body: Body, cells: IntArray) -> Array:
    """From the biharmonic shape, until it rests."""
    part = Part(body, cells)
    data = igl.ARAPData()
    data.max_iter = 10
    igl.arap_precomputation(part.x, part.cells, 3, part.points.astype(np.int32), data)
    x = np.ascontiguousarray(_harmonic(part))
    for _ in range(ROUNDS // data.max_iter):
        before, x = x, np.ascontiguousarray(igl.arap_solve(part.targets, data, x))
        moved = float(np.abs(x - before).max())
        if moved < data.max_iter * SETTLED:
            return part.whole(x)
    raise ConvergenceError(
        "as-rigid-as-possible", f"vertices still move by {moved:.2g} mm", "Give fewer marks"
    )


def icp_amberg(body: Body) -> Array:
    """Non-rigid ICP with an affine map a vertex (Amberg 2007)."""
    part = Part(body, body.mesh.boundary_faces()[0])
    shell = trimesh.Trimesh(part.x, part.cells, process=False)
    found = trimesh.registration.nricp_amberg(
        shell,
        part.targets,
        part.points,
        part.targets,
        steps=[[0.001, 10.0, 0.0, 3]],
        gamma=20.0,
        distance_threshold=1e-6,
        use_faces=False,
    )
    return part.whole(found)


def icp_sumner(body: Body) -> Array:
    """Non-rigid ICP with an affine map a triangle (Sumner and Popovic 2004)."""
    part = Part(body, body.mesh.boundary_faces()[0])
    shell = trimesh.Trimesh(part.x, part.cells, process=False)
    steps = [[0.0, 0.001, 1.0, 1000.0, 0.0]]
    found = trimesh.registration.nricp_sumner(
        shell, part.targets, part.points, part.targets, steps=steps, use_faces=False
    )
    return part.whole(found)


METHODS = {
    "plastic": plastic,
    "arap_volume": arap_volume,
    "arap_surface": arap_surface,
    "biharmonic_volume": biharmonic_volume,
    "biharmonic_linear": biharmonic_linear,
    "biharmonic_surface": biharmonic_surface,
    "bounded_biharmonic": bounded_biharmonic,
    "bending": bending,
    "bending_incremental": bending_incremental,
    "primo": primo,
    "elastic": elastic,
    "elastic_incremental": elastic_incremental,
    "transfer": transfer,
    "icp_amberg": icp_amberg,
    "icp_sumner": icp_sumner,
}
