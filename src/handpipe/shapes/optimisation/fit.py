"""The shape of a body in one pose, from what the image shows.

The search finds smooth strains near a guess whose equilibrium matches the image (Wang 2021 chapter 5; Zheng
2022 §4). It is coarse to fine: uniform strain first, then more of the smoothest strain fields. Each
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
from handpipe.shapes.observations.attachment_targets import AttachmentTargets
from handpipe.shapes.observations.correspondence import Correspondence, Markers
from handpipe.shapes.optimisation.search import Search, StepRecord
from handpipe.shapes.optimisation.settings import ShapeOptions
from handpipe.shapes.optimisation.smooth_fields import SmoothFields
from handpipe.shapes.optimisation.strain_space import FindMarks, Stage, State

FindMarkers = Callable[[Surface], Markers]


@dataclass
class ShapeFit:
    """Fitted shape of a body and the plastic strains under which it is the equilibrium.

    Parameters
    ----------
    vertices : array (n, 3)
        Fitted tet vertices in mm.
    strains : array (m, 6)
        Plastic strains as xx, xy, xz, yy, yz, zz.
    record : list of StepRecord
        Every step of the search.
    """

    vertices: Array
    strains: Array
    record: list[StepRecord] = field(default_factory=list)

    def table(self) -> dict[str, list[float] | list[str]]:
        """The record by columns, for an artifact."""
        return artifacts.columns(self.record)


@dataclass(frozen=True)
class EmbeddedSurface:
    """A body at rest with a surface that it carries.

    Parameters
    ----------
    mesh : TetMesh
        Body at rest with n vertices, in mm.
    surface : Surface
        Surface at rest with v vertices, in mm.
    embedding : sparse matrix (v, n)
        Takes positions of the body's vertices to those of the surface's.
    """

    mesh: TetMesh
    surface: Surface
    embedding: sparse.csr_matrix

    def at(self, x: Array) -> Surface:
        """The surface where the body's vertices are x (n, 3)."""
        return self.surface.moved(self.embedding @ x)


@dataclass(frozen=True)
class KnownPoints:
    """Points of a body whose places are known.

    Parameters
    ----------
    attached : Attached
        Attached points.
    loose : sequence of sparse matrix (t_i, n)
        Weights of the body's vertices for the points of loose ends. Each end is attached to a rigid body of
        unknown place: the search finds it, from the end's place in the guess.
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
    """Shape of a body in one pose, fitted to markers on its boundary.

    Parameters
    ----------
    body : EmbeddedSurface
        Body at rest and its surface.
    known : KnownPoints
        Attachments, loose ends and landmarks.
    find_markers : callable
        From the current surface to the image's boundary points near it; called before every step.
    start : array (n, 3), optional
        Vertices of a first guess in mm, from whose strains the search begins; by default the body at rest.
    options : ShapeOptions, optional
        Weights and stopping criteria.

    Returns
    -------
    ShapeFit
        Fitted vertices in mm, plastic strains and every step.

    Raises
    ------
    ConvergenceError
        If no equilibrium is found at the start, or the stiffness matrix becomes singular.

    References
    ----------
    Wang 2021 chapter 5; Zheng 2022 §4.
    """
    options = options or ShapeOptions()
    mesh = body.mesh
    x = mesh.vertices if start is None else start
    space = SmoothFields(mesh, x, options)
    search = Search(mesh, space, options, name="shape from plastic strains")
    state = search.at(space.guess, AttachmentTargets.place(known.attached, known.loose, x), x)
    nothing = Correspondence.none(len(mesh.vertices))
    landmarks = nothing
    if known.landmarks is not None:
        landmarks = Correspondence(known.landmarks.matrix, known.landmarks.targets, None)

    def closest(x: Array) -> Correspondence:
        present = body.at(x)
        found = Correspondence.match(find_markers(present), present, body.embedding, options.tangential)
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
