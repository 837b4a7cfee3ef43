"""The shape of a body in one pose: smooth strains near a guess whose equilibrium meets what the image shows
(Wang 2021 chapter 5; Zheng 2022 §4).

The search is coarse to fine: uniform strain first, then more of the smoothest strain fields. Each
Gauss-Newton step costs one factorisation of the stiffness matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from scipy import sparse

from handpipe import artifacts
from handpipe.arrays import Array
from handpipe.mesh.surface import Surface
from handpipe.mesh.tetrahedra import TetMesh
from handpipe.shapes.attached import Attached
from handpipe.shapes.correspondence import Correspondence, Markers
from handpipe.shapes.holds import Holds
from handpipe.shapes.search import Record, Search
from handpipe.shapes.settings import ShapeOptions
from handpipe.shapes.smooth_fields import SmoothFields
from handpipe.shapes.strain_space import FindMarks, Stage, State

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


def fit_shape(
    mesh: TetMesh,
    surface: Surface,
    embedding: sparse.csr_matrix,
    attached: Attached,
    find_markers: FindMarkers,
    *,
    loose: Sequence[sparse.csr_matrix] = (),
    landmarks: Attached | None = None,
    start: Array | None = None,
    options: ShapeOptions | None = None,
) -> ShapeFit:
    """Fit a body to markers on its boundary.

    mesh: the body at rest; surface: its embedded surface at rest, carried by embedding (v, n); find_markers
    gives the image's boundary points near the present surface and is called before every step; landmarks:
    known places of points of the body, used before the markers and with them; start: vertices (n, 3) of a
    first guess, whose strains the search begins with; loose: matrices (t_i, n) of points of ends that are
    held somewhere, each as a rigid body whose place is sought from the guess's on. Raises `ConvergenceError`
    where no equilibrium is found at the start.
    """
    options = options or ShapeOptions()
    x = mesh.vertices if start is None else start
    space = SmoothFields(mesh, x, options)
    search = Search(mesh, space, options, name="shape from plastic strains")
    state = search.at(space.guess, Holds.of(attached, loose, x), x)
    nothing = Correspondence.none(len(mesh.vertices))
    known = nothing if landmarks is None else Correspondence(landmarks.matrix, landmarks.targets, None)

    def closest(x: Array) -> Correspondence:
        present = surface.moved(embedding @ x)
        found = Correspondence.of(find_markers(present), present, embedding, options.tangential)
        return found if landmarks is None else found.joined(known)

    def towards(name: str, find: FindMarks, fields: Sequence[int], state: State) -> State:
        for count in fields:
            stage = Stage(f"{name} {count}", find, options.alpha, count, options.iterations)
            state = search.run(state, stage)
            if search.near:
                break
        return state

    state = towards("attachments", lambda x: nothing, options.fields[:1], state)
    if landmarks is not None:
        state = towards("landmarks", lambda x: known, options.fields[:2], state)
    state = towards("markers", closest, options.fields, state)
    return ShapeFit(state.x, state.body.strains, search.record)
