"""The shape of a body in one pose, from what the image shows.

Smooth strains near a guess, whose equilibrium meets what the image shows (Wang 2021 chapter 5; Zheng 2022
§4). The search is coarse to fine: uniform strain first, then more of the smoothest strain fields. Each
Gauss-Newton step costs one factorisation of the stiffness matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from scipy import sparse

from handpipe.core import Array, artifacts
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import TetMesh
from handpipe.shapes.observations.attached import Attached
from handpipe.shapes.observations.correspondence import Correspondence, Markers
from handpipe.shapes.observations.holds import Holds
from handpipe.shapes.optimisation.search import Record, Search
from handpipe.shapes.optimisation.settings import ShapeOptions
from handpipe.shapes.optimisation.smooth_fields import SmoothFields
from handpipe.shapes.optimisation.strain_space import FindMarks, Stage, State

FindMarkers = Callable[[Surface], Markers]


@dataclass
class ShapeFit:
    """Fitted tet vertices (n, 3), plastic strains (m, 6) whose equilibrium they are, and every step."""

    vertices: Array
    strains: Array
    record: list[Record] = field(default_factory=list)

    def table(self) -> dict[str, list[float] | list[str]]:
        """The record by columns, for an artifact."""
        return artifacts.columns(self.record)


@dataclass(frozen=True)
class EmbeddedSurface:
    """A body at rest, its surface at rest, and the matrix embedding (v, n) by which the body carries that."""

    mesh: TetMesh
    surface: Surface
    embedding: sparse.csr_matrix

    def at(self, x: Array) -> Surface:
        """The surface where the body's vertices are x (n, 3)."""
        return self.surface.moved(self.embedding @ x)


@dataclass(frozen=True)
class KnownPoints:
    """Points of a body whose places are known.

    Attributes
    ----------
    attached : Attached
        Attached points.
    loose : sequence of (t_i, n)
        Matrices of points of ends that are held somewhere, each as a rigid body whose place is searched from
        the guess's on.
    landmarks : Attached, optional
        Landmarks, which are used before the markers and with them.
    """

    attached: Attached
    loose: Sequence[sparse.csr_matrix] = ()
    landmarks: Attached | None = None


def fit_shape(
    body: EmbeddedSurface,
    known: KnownPoints,
    find_markers: FindMarkers,
    *,
    start: Array | None = None,
    options: ShapeOptions | None = None,
) -> ShapeFit:
    """Fit a body to markers on its boundary.

    find_markers gives the image's boundary points near the present surface and is called before every step;
    start: vertices (n, 3) of a first guess, whose strains the search begins with. Raises `ConvergenceError`
    where no equilibrium is found at the start.
    """
    options = options or ShapeOptions()
    mesh = body.mesh
    x = mesh.vertices if start is None else start
    space = SmoothFields(mesh, x, options)
    search = Search(mesh, space, options, name="shape from plastic strains")
    state = search.at(space.guess, Holds.of(known.attached, known.loose, x), x)
    nothing = Correspondence.none(len(mesh.vertices))
    landmarks = nothing
    if known.landmarks is not None:
        landmarks = Correspondence(known.landmarks.matrix, known.landmarks.targets, None)

    def closest(x: Array) -> Correspondence:
        present = body.at(x)
        found = Correspondence.of(find_markers(present), present, body.embedding, options.tangential)
        return found.joined(landmarks) if landmarks.count else found

    def towards(name: str, find: FindMarks, fields: Sequence[int], state: State) -> State:
        for count in fields:
            stage = Stage(f"{name} {count}", find, options.alpha, count, options.iterations)
            state = search.run(state, stage)
            if search.near:
                break
        return state

    state = towards("attachments", lambda x: nothing, options.fields[:1], state)
    if landmarks.count:
        state = towards("landmarks", lambda x: landmarks, options.fields[:2], state)
    state = towards("markers", closest, options.fields, state)
    return ShapeFit(state.x, state.body.strains, search.record)
