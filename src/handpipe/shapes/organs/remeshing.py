"""Remeshing where strains have degraded tets (Wang 2021 §5.10 leaves it open).

The current shape is remeshed and becomes the rest shape, free of stress: the stress of the old tets came from
the misfit of their strains, which would not fit new tets. Under loads there is stress: in a tet whose elastic
deformation is F_e = V R, the plastic strain V^-1 from the current shape gives the same stress at the same
place, since the material is isotropic. Averages over tets and springs move the equilibrium off the current
shape; a few steps towards that shape bring it back. The log-strains that the search smooths are transferred
(`strain_frame.py`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, HandpipeError
from handpipe.fem.elements import plasticity
from handpipe.fem.potentials import Elastic, Potential
from handpipe.imaging.volumes import Volume
from handpipe.mesh.generation import remesh, tetrahedralise
from handpipe.mesh.tets import Embedding, TetMesh
from handpipe.shapes.observations.attached import Attached
from handpipe.shapes.observations.attachment_targets import AttachmentTargets
from handpipe.shapes.observations.carried import Carried
from handpipe.shapes.observations.correspondence import Correspondence
from handpipe.shapes.observations.image_marks import ImageMarks
from handpipe.shapes.observations.marks import BoundaryMarks, with_landmarks
from handpipe.shapes.optimisation.all_tets import AllTets
from handpipe.shapes.optimisation.search import Search, StepRecord
from handpipe.shapes.optimisation.settings import OrganSettings
from handpipe.shapes.optimisation.strain_space import FindMarks, Stage, State
from handpipe.shapes.strains.strain_frame import StrainFrame

EARLY = 4  # steps of a stage that another one follows
WORSE = 0.7  # of the angle at rest: strains have not degraded tets that were bad from the start
BETTER = 1.5  # times the angle before: new tets with less are not used
HINDERED = 0.25  # length of a step: tets shortened it
FINER = (1.0, 0.7, 0.5)  # relative edge lengths to try: thin parts may need shorter ones
PACKED = 4.6  # cube of the edge length that tets are made with, over their mean volume
KEPT = 200  # points that keep the shape meanwhile
LOST = 0.1  # of the volume: edges longer than a part is thick lose that part
STRETCH = 3.0  # largest elastic stretch, either way, that is transferred


@dataclass(frozen=True)
class Given:
    """Input of a fit, on the template: marks (r, 3), attached points, landmarks, loads, an image."""

    template: TetMesh
    marks: Array
    attached: Attached | None
    known: Attached | None
    loads: tuple[Potential, ...]
    image: Volume | None
    settings: OrganSettings


class OnMesh:
    """The search on one mesh at rest.

    carry (n0, n) takes its vertices to those of the template; frame: of its log-strains.
    """

    def __init__(
        self,
        given: Given,
        mesh: TetMesh,
        carry: sp.csr_matrix | None,
        frame: StrainFrame | None,
        record: list[StepRecord],
    ) -> None:
        """carry, frame: None where the mesh is the template itself."""
        self.given, self.mesh = given, mesh
        self.carry = sp.identity(len(mesh.vertices), format="csr") if carry is None else carry
        loads = given.loads if carry is None else [Carried(p, carry) for p in given.loads]
        settings = given.settings
        attached = (given.attached or Attached.nothing(self.carry.shape[0])).carried(self.carry)
        self.attachments = AttachmentTargets.place(attached, (), mesh.vertices)
        self.frame = frame
        self.search = Search(mesh, AllTets(mesh.tets, settings, frame), settings, loads)
        self.search.record = record
        self.known = None if given.known is None else given.known.carried(self.carry)
        robust = settings.mark_error if settings.outliers else None
        self.marks = BoundaryMarks(mesh, given.marks, settings.tangential, robust, settings.covering)
        image = given.image
        self.image = None if image is None else ImageMarks(mesh, image, settings.tangential)

    @staticmethod
    def of_template(given: Given) -> OnMesh:
        """On the template itself."""
        return OnMesh(given, given.template, None, None, [])

    def find(self, uses: str) -> FindMarks:
        """The function that finds the marks of a stage with "nothing", "landmarks", "marks" or "image"."""

        def found(x: Array) -> Correspondence:
            marks = self.marks(x) if uses in ("marks", "image") else Correspondence.none(len(x))
            return marks.joined(self.image(x)) if uses == "image" and self.image is not None else marks

        return found if uses == "nothing" else with_landmarks(found, self.known)


def worn(task: OnMesh, state: State) -> bool:
    """Whether strains have degraded tets: some are flat or tangled, or prevent steps."""
    below = task.given.settings.remesh_below
    smallest = task.mesh.moved(state.x).smallest_dihedral()
    if below == 0.0 or smallest >= WORSE * task.mesh.smallest_dihedral():
        return False
    return smallest < below or state.tangles > 0 or _stuck(task.search)


def _stuck(search: Search) -> bool:
    return search.hindered and search.record[-1].step < HINDERED


def remeshed(task: OnMesh, state: State) -> tuple[OnMesh, State]:
    """The search on new tets of the current shape, about as many as the template's, and the state there.

    Raises `HandpipeError` where the shape cannot be meshed or new tets would be no better.
    """
    present = task.mesh.moved(state.x)
    share = float(present.volumes().sum()) / len(task.given.template.tets)
    mesh = _meshed(present, (PACKED * share) ** (1 / 3))
    points = task.carry @ state.x
    carry = Embedding.embed(points, mesh).matrix(len(mesh.vertices))
    since, total, rotations = _carried_fields(task, state, mesh)
    frame = StrainFrame.align(rotations, total, since)
    new = OnMesh(task.given, mesh, carry, frame, task.search.record)
    return new, _kept(new, new.search.at(total, new.attachments, mesh.vertices))


def _kept(task: OnMesh, state: State) -> State:
    """The state after a few steps towards the shape at rest, if it has departed from that."""
    rest = task.mesh.vertices
    if np.linalg.norm(state.x - rest, axis=1).max() < task.given.settings.enough:
        return state
    outer = task.mesh.boundary_vertices()
    outer = outer[:: -(-len(outer) // KEPT)]
    places = Attached.vertices(outer, rest[outer], len(rest))
    shape = Correspondence(places.matrix, places.targets, None)
    stage = Stage("keeping the shape", lambda x: shape, task.given.settings.alpha, None, EARLY)
    return task.search.run(state, stage)


def _meshed(present: TetMesh, edge: float) -> TetMesh:
    """Tets of about `edge` mm in the present shape; the surface's vertices lie on it."""
    before, volume = present.smallest_dihedral(), present.volumes().sum()
    surface = present.boundary().compact()
    reason: HandpipeError = HandpipeError("remeshing: no edge length was tried")
    for share in FINER:
        try:
            mesh = tetrahedralise(remesh(surface, share * edge), share * edge)
        except HandpipeError as error:
            reason = error
            continue
        smallest = mesh.smallest_dihedral()
        lost = 1 - mesh.volumes().sum() / volume
        if smallest > BETTER * before and abs(lost) < LOST:
            return mesh
        figures = f"{smallest:.2f} deg at the smallest angle after {before:.2f}, {100 * lost:.1f} % smaller"
        reason = HandpipeError(f"remeshing: new tets would be no better: {figures}")
    raise reason


def _carried_fields(task: OnMesh, state: State, mesh: TetMesh) -> tuple[Array, Array, Array]:
    """Log-strains and rotations carried to the tets of a mesh of the present shape.

    They are log-strains from now on (m, 6), total log-strains (m, 6), and rotations from the template (m, 3,
    3).
    """
    present, frame = task.mesh.moved(state.x), task.frame
    turn = state.body.deformation_gradients(state.x)
    if frame is not None:
        turn = turn @ frame.rotations
    turn = plasticity.polar(np.ascontiguousarray(turn))[0]
    loaded = len(task.given.loads) > 0
    since = residual_logs(state.body, state.x) if loaded else np.zeros_like(state.unknowns)
    fields = np.column_stack([since, state.unknowns, turn.reshape(-1, 9)])
    since, total, turned = np.split(_carried(present, fields, mesh), [6, 12], axis=1)
    return since, total, plasticity.polar(np.ascontiguousarray(turned.reshape(-1, 3, 3)))[0]


def residual_logs(body: Elastic, x: Array) -> Array:
    """-log V (m, 6), with V the left stretch of the elastic deformation of a body at vertices x (n, 3)."""
    left = plasticity.polar(np.ascontiguousarray(np.swapaxes(body.elastic_gradients(x), 1, 2)))[1]
    values, vectors = np.linalg.eigh(plasticity.to_matrices(left))
    logs = np.log(np.clip(values, 1 / STRETCH, STRETCH))
    return -plasticity.from_matrices((vectors * logs[:, None]) @ vectors.transpose(0, 2, 1))


def _carried(old: TetMesh, fields: Array, new: TetMesh) -> Array:
    """Fields (m, k) of one mesh's tets, averaged at its vertices, at the centres (l, k) of another one's."""
    shares = np.repeat(np.maximum(old.volumes(), 0.0), 4)
    places = (old.tets.ravel(), np.repeat(np.arange(len(fields)), 4))
    gather = sp.csr_matrix((shares, places), shape=(len(old.vertices), len(fields)))
    at_vertices = (gather @ fields) / np.maximum(np.asarray(gather.sum(axis=1)), 1e-300)
    centres = new.vertices[new.tets].mean(axis=1)
    return Embedding.embed(centres, old)(at_vertices)
