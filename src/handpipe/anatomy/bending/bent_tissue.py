"""A mesh of tissues between bones of which some move: its static equilibrium, in steps of an angle."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.anatomy.templates.tissue_mesh import TissueMesh
from handpipe.core import Array, BoolArray, ConvergenceError, InputError, RigidTransform
from handpipe.fem.elements import Material, plasticity
from handpipe.fem.potentials import Elastic
from handpipe.fem.solver import Options, Steps, continuation
from handpipe.mesh.contact import cuts_itself, gliding
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.mesh.tets import TetMesh

ANGLE = np.radians(10.0)  # of a step
SHORTENING = 0.1  # of a muscle, in a step
PASSED = (0.25, 0.5, 0.75, 1.0)  # of the turn: positions in which bones glide past one another
STEP, FORCE = 1e-3, 1e-4  # mm, and of the forces on a vertex: when an equilibrium has converged
OVERLAP = 0.1  # mm of one bone in another, or in tissue, of which a note tells
SHORTEST = 1 / 16  # of a step, below which the solve gives up
NAME = "the pose"  # in messages


@dataclass(frozen=True, eq=False)
class Bend:
    """What moves, and how.

    Parameters
    ----------
    moving : sequence of str
        Bones that turn as one; all others stay.
    centre, axis : array (3,)
        Place in mm, unit vector.
    angle : float
        In rad, by the right-hand rule.
    shortening : mapping of str to float
        By how much muscles contract along their fibres if nothing resists, as a share of their length.
    """

    moving: Sequence[str]
    centre: Array
    axis: Array
    angle: float
    shortening: Mapping[str, float] = field(default_factory=dict)

    def motion(self, share: float = 1.0) -> RigidTransform:
        """The moving bones' motion from rest, at a share of the turn."""
        turn = Rotation.from_rotvec(share * self.angle * self.axis).as_matrix()
        return RigidTransform.about(self.centre, turn)

    @property
    def steps(self) -> int:
        """Number of steps, one at least."""
        widest = max([abs(self.angle) / ANGLE, *(s / SHORTENING for s in self.shortening.values())])
        return max(int(np.ceil(widest - 1e-9)), 1)


@dataclass(frozen=True)
class Step:
    """A step that has converged.

    Parameters
    ----------
    number, steps : int
        Which of how many, from one.
    angle : float
        Of the moving bones now, in rad.
    residual : float
        Largest unbalanced force on a vertex in mN.
    iterations : int
        Of Newton's method in this step.
    """

    number: int
    steps: int
    angle: float
    residual: float
    iterations: int


@dataclass(frozen=True, eq=False)
class BentLimb:
    """The tissues in equilibrium.

    Parameters
    ----------
    mesh : TetMesh
        The tissues' mesh in the pose, in mm.
    bones : mapping of str to RigidTransform
        Motions from rest.
    residual : float
        Largest unbalanced force on a vertex in mN.
    notes : tuple of str
        What a person should know of it: overlaps.
    """

    mesh: TetMesh
    bones: Mapping[str, RigidTransform]
    residual: float
    notes: tuple[str, ...] = ()


def follow_bend(
    tissue: TissueMesh,
    bones: Mapping[str, Surface],
    pairs: Iterable[tuple[str, str]],
    materials: Mapping[str, Material],
    bend: Bend,
    progress: Callable[[Step], None] = lambda step: None,
) -> BentLimb:
    """The equilibrium of a mesh of tissues after a bend.

    Tissue is attached where its mesh is on bones. Between the bones of a joint it is attached to neither,
    where these come within the joint's gap and an edge of one another during the turn. There is no contact.

    Parameters
    ----------
    tissue : TissueMesh
        The tissues at rest.
    bones : mapping of str to Surface
        The bones at rest, in mm.
    pairs : iterable of (str, str)
        Joints between bones that move and bones that stay.
    materials : mapping of str to Material
        Of each tissue of the mesh.
    bend : Bend
        What moves, and how.
    progress : callable
        Gets each step after it has converged.

    Returns
    -------
    BentLimb

    Raises
    ------
    InputError
        For a tissue without a material, or a muscle that the mesh does not have.
    ConvergenceError
        Where a step has no equilibrium, or one with inverted tets.
    """
    unknown = sorted({*bend.shortening, *tissue.names} - set(materials)) + sorted(
        set(bend.shortening) - set(tissue.names[1:])
    )
    if unknown:
        raise InputError(NAME, "tissue", f"{unknown[0]!r} is no muscle of the mesh", "Name another one")
    limb = _Limb(tissue, bones, tuple(pairs), materials, bend)
    x, residual, steps = tissue.mesh.vertices, 0.0, bend.steps
    for number in range(1, steps + 1):
        x, residual, iterations = limb.step(x, (number - 1) / steps, number / steps)
        progress(Step(number, steps, bend.angle * number / steps, residual, iterations))
    return BentLimb(TetMesh(x, tissue.mesh.tets), limb.motions(1.0), residual, tuple(limb.notes(x)))


class _Limb:
    """A mesh of tissues, and which of its vertices bones carry."""

    def __init__(
        self,
        tissue: TissueMesh,
        bones: Mapping[str, Surface],
        pairs: Sequence[tuple[str, str]],
        materials: Mapping[str, Material],
        bend: Bend,
    ) -> None:
        self.tissue, self.bones, self.pairs, self.bend = tissue, bones, pairs, bend
        constants = [(materials[name].young, materials[name].poisson) for name in tissue.names]
        young, poisson = np.array(constants, dtype=float).T[:, tissue.labels]
        self.elastic = Elastic(tissue.mesh.vertices, tissue.mesh.tets, Material(young, poisson))
        self.gliding = self._gliding()
        on_bones = np.zeros(len(self.gliding), dtype=bool)
        on_bones[np.concatenate(list(tissue.bones.values()))] = True
        self.fixed: BoolArray = np.repeat(on_bones & ~self.gliding, 3)

    def motions(self, share: float) -> dict[str, RigidTransform]:
        """All bones' motions from rest at a share of the turn."""
        moved, still = self.bend.motion(share), RigidTransform.identity()
        return {name: moved if name in self.bend.moving else still for name in self.tissue.bones}

    def step(self, x: Array, start: float, end: float) -> tuple[Array, float, int]:
        """From the equilibrium x (n, 3) at one share to that at another; residual in mN, iterations.

        Raises
        ------
        ConvergenceError
            Where there is none, or one with inverted tets.
        """
        options = Options(STEP, FORCE, untangle=False, barrier=True, name=NAME)

        def between(t: float) -> float:
            return start + t * (end - start)

        try:
            found = continuation(
                lambda t: [self._contracted(between(t))],
                x,
                fixed=self.fixed,
                prescribed=lambda t: self._prescribed(x, between(t)),
                options=options,
                steps=Steps(first=1.0, smallest=SHORTEST),
            )
        except ConvergenceError as error:
            first, last = (f"{np.degrees(share * self.bend.angle):.0f}" for share in (start, end))
            reason = f"between {first} and {last} degrees: {error.reason}"
            raise ConvergenceError(NAME, reason, "Bend less, or make tets of shorter edges.") from error
        return found.x, found.record.residuals[-1], found.record.iterations

    def notes(self, x: Array) -> list[str]:
        """Sentences on what overlaps at positions x (n, 3), since there is no contact."""
        at = self.motions(1.0)
        distances = {name: Distance(surface) for name, surface in self.bones.items()}

        def depth(points: Array, bone: str) -> float:
            signed = distances[bone].signed(at[bone].inverse()(points))[0]
            return -min(float(signed.min(initial=0.0)), 0.0)

        folded = self.elastic.tangles.count(x)
        said = [f"tissue is folded at {folded} edges of tets"] if folded else []
        for one, other in self.pairs:
            deep = max(depth(at[a](self.bones[a].vertices), b) for a, b in ((one, other), (other, one)))
            if deep > OVERLAP:
                said.append(f"{one} and {other} overlap by {deep:.1f} mm: move the centre, or bend less")
        deep = max((depth(x[self.gliding], name) for pair in self.pairs for name in pair), default=0.0)
        if deep > OVERLAP:
            said.append(f"tissue at the joint overlaps a bone by {deep:.1f} mm")
        if cuts_itself(self._skin(x)):
            said.append("the skin passes through itself in the crease")
        return said

    def _skin(self, x: Array) -> Surface:
        faces = self.tissue.mesh.boundary_faces()[0]
        return Surface(x, faces[np.isin(faces, self.tissue.skin).all(axis=1)]).compact()

    def _gliding(self) -> BoolArray:
        """Vertices (n,) on bones of a joint that the other bone passes."""
        mesh, none = self.tissue.mesh, np.zeros(len(self.tissue.mesh.vertices), dtype=bool)
        if not self.pairs or self.bend.angle == 0.0:
            return none
        gaps = [Distance(self.bones[a]).closest(self.bones[b].vertices)[0].min() for a, b in self.pairs]
        reach = float(max(gaps)) + mesh.edge_length()
        positions = [self.motions(share) for share in PASSED]
        return gliding(mesh.vertices, self.tissue.bones, self.bones, self.pairs, positions, reach)

    def _prescribed(self, x: Array, share: float) -> Array:
        """Positions x (n, 3) with the vertices on bones where these have them."""
        out, rest = x.copy(), self.tissue.mesh.vertices
        for name, motion in self.motions(share).items():
            out[self.tissue.bones[name]] = motion(rest[self.tissue.bones[name]])
        return out

    def _contracted(self, share: float) -> Elastic:
        """The tissues, of which muscles are shorter along their fibres and thicker across by a share."""
        if not any(self.bend.shortening.values()):
            return self.elastic
        logs = np.zeros((len(self.tissue.labels), 6))
        for name, shortening in self.bend.shortening.items():
            own = self.tissue.labels == self.tissue.names.index(name)
            along = self.tissue.fibres[own]
            shape = 1.5 * along[:, :, None] * along[:, None, :] - 0.5 * np.eye(3)
            logs[own] = np.log(1.0 - share * shortening) * plasticity.from_matrices(shape)
        return self.elastic.with_strains(plasticity.exp(logs))
