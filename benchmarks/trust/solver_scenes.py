"""Random scenes for the equilibrium solver: soft bars on springs and planes, under loads, near a plate.

A scene holds plain arrays, so that it can be judged without the solver's potentials. Units are mm, kPa, mN.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from benchmarks.fem.scenes import Body, box, with_slivers
from handpipe.core import Array, BoolArray, IntArray
from handpipe.fem.contact import Attachment, Barrier, CollidingPairs, Contact
from handpipe.fem.elements import Material
from handpipe.fem.potentials import Elastic, Potential, Pull

ONSET = 0.05  # mm of the penalty of planes
REACH = 0.05  # mm at which the plate begins to push
KINDS = ("springs", "embedded", "prestressed", "two", "slivers", "planes", "plate")
UNSUPPORTED = ("free", "sliding", "stray")


@dataclass
class Scene:
    """Tets with Young's and Poisson's ratio each, springs, planes, a plate below z = `plate`, and loads.

    spring_points (s, n) and plane_points (c, n) take vertices to points. `supported` tells whether there is
    an equilibrium.
    """

    kind: str
    body: Body
    young: Array
    poisson: float
    load: Array
    spring_points: sp.csr_matrix
    targets: Array
    spring_stiffness: Array
    plane_points: sp.csr_matrix
    heights: Array
    plane_stiffness: float = 0.0
    plate: float | None = None
    fixed: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    supported: bool = True

    def potentials(self) -> list[Potential]:
        """What the solver minimises."""
        x, every = self.body.vertices, sp.eye(len(self.body.vertices), format="csr")
        parts: list[Potential] = [
            Elastic(x, self.body.tets, Material(self.young, self.poisson)),
            Pull(every, self.load),
        ]
        if self.spring_points.shape[0]:
            parts.append(Attachment(self.spring_points, self.targets, self.spring_stiffness))
        if self.plane_points.shape[0]:
            up = np.tile([0.0, 0.0, 1.0], (len(self.heights), 1))
            below = self.heights[:, None] * up
            parts.append(Contact(self.plane_points, below, up, self.plane_stiffness, ONSET))
        if self.plate is not None:
            # One triangle: edges of the plate below those of the bar would push sideways, too.
            corners = np.array([[-300.0, -200, 0], [300, -200, 0], [0, 400, 0]])
            obstacle = corners + [0.0, 0.0, self.plate], np.array([[0, 1, 2]])
            faces = self.body.triangles
            parts.append(
                Barrier(
                    every, faces, x, REACH, 6.0, obstacle=obstacle, pairs=CollidingPairs(self_contact=False)
                )
            )
        return parts


def draw(number: int, unsupported: bool = False) -> Scene:
    """Scene of a seed; kinds come in turn."""
    rng = np.random.default_rng(number)
    kinds = UNSUPPORTED if unsupported else KINDS
    kind = kinds[number % len(kinds)]
    scene = _bar(rng, kind)
    _BUILD[kind](scene, rng)
    return scene


def _bar(rng: np.random.Generator, kind: str) -> Scene:
    """A bar along x with a load on its tip, which nothing holds yet."""
    size = (float(rng.uniform(3, 6)), float(rng.uniform(0.8, 1.6)), float(rng.uniform(0.8, 1.6)))
    body = box(size, (int(rng.integers(4, 7)), 2, 2))
    body = body.moved(body.vertices + np.array(size) / 2 + [0.0, 0.0, 0.02])
    if kind == "slivers":
        body = with_slivers(body, float(10 ** rng.uniform(-4, -1)), 1.0, int(rng.integers(1000)))
    count = len(body.vertices)
    young = float(10 ** rng.uniform(0, 4))
    load = np.zeros((count, 3))
    tip = body.vertices[:, 0] > size[0] - 1e-9
    # A load that bends the bar by a tenth of its length, or far less.
    bend = 0.3 * young * size[1] * size[2] ** 3 / size[0] ** 2 / 4 / tip.sum()
    load[tip] = bend * 10 ** rng.uniform(-4, 0) * _direction(rng)
    none = sp.csr_matrix((0, count))
    poisson = float(rng.uniform(0.2, 0.48))
    every = np.full(len(body.tets), young)
    return Scene(kind, body, every, poisson, load, none, np.zeros((0, 3)), np.zeros(0), none, np.zeros(0))


def _direction(rng: np.random.Generator) -> Array:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def _stiffnesses(rng: np.random.Generator, young: float, count: int) -> Array:
    """Each its own, over twelve orders of magnitude about the material's."""
    return np.asarray(young * 10 ** rng.uniform(0, 12, count))


def _root(scene: Scene) -> IntArray:
    return np.flatnonzero(scene.body.vertices[:, 0] < 1e-9)


def _hold(scene: Scene, points: sp.csr_matrix, offsets: Array | float, stiffness: Array) -> None:
    """Add springs from points to where they are, moved by offsets."""
    targets = points @ scene.body.vertices + offsets
    scene.spring_points = sp.vstack([scene.spring_points, points], format="csr")
    scene.targets = np.concatenate([scene.targets, targets])
    scene.spring_stiffness = np.concatenate([scene.spring_stiffness, stiffness])


def _vertex_points(scene: Scene, chosen: IntArray) -> sp.csr_matrix:
    return sp.eye(len(scene.body.vertices), format="csr")[chosen]


def _springs(scene: Scene, rng: np.random.Generator) -> None:
    root = _root(scene)
    stiffness = _stiffnesses(rng, float(scene.young[0]), len(root))
    _hold(scene, _vertex_points(scene, root), 0.0, stiffness)


def _embedded(scene: Scene, rng: np.random.Generator) -> None:
    """Springs on points inside of the tets at the root: their stiffness is no vertex's own."""
    centres = scene.body.vertices[scene.body.tets].mean(axis=1)
    chosen = np.argsort(centres[:, 0])[:8]
    weights = rng.dirichlet(np.ones(4), len(chosen))
    starts = np.arange(0, 4 * len(chosen) + 1, 4)
    shape = (len(chosen), len(scene.body.vertices))
    points = sp.csr_matrix((weights.ravel(), scene.body.tets[chosen].ravel(), starts), shape=shape)
    _hold(scene, points, 0.0, float(scene.young[0]) * 10 ** rng.uniform(0, 12, len(chosen)))


def _prestressed(scene: Scene, rng: np.random.Generator) -> None:
    """Opposed springs on the same vertices, whose forces are large against the load."""
    root = _root(scene)
    offset = 0.1 * _direction(rng)
    stiffness = float(scene.young[0]) * 10 ** rng.uniform(0, 8, len(root))
    for sign in (1.0, -1.0):
        _hold(scene, _vertex_points(scene, root), sign * offset, stiffness)


def _two(scene: Scene, rng: np.random.Generator) -> None:
    """A second bar beside, a million times stiffer, with springs and a load of its own."""
    body, count = scene.body, len(scene.body.vertices)
    vertices = np.concatenate([body.vertices, body.vertices + [0.0, 5.0, 0.0]])
    scene.body = Body(
        vertices,
        np.concatenate([body.tets, body.tets + count]),
        np.concatenate([body.triangles, body.triangles + count]),
    )
    scene.young = np.concatenate([scene.young, 1e6 * scene.young])
    scene.load = np.concatenate([scene.load, 10 ** rng.uniform(-3, 3) * scene.load])
    scene.spring_points = scene.plane_points = sp.csr_matrix((0, 2 * count))
    _springs(scene, rng)


def _planes(scene: Scene, rng: np.random.Generator) -> None:
    """The root on springs, the underside on a plane of its own stiffness, pressed down."""
    _springs(scene, rng)
    x = scene.body.vertices
    lowest = np.flatnonzero(x[:, 2] < x[:, 2].min() + 1e-9)
    scene.plane_points = _vertex_points(scene, lowest)
    scene.heights = np.full(len(lowest), x[:, 2].min() - 0.05 * rng.uniform())
    scene.plane_stiffness = float(scene.young[0] * 10 ** rng.uniform(0, 4))
    scene.load[:, 2] = -np.abs(scene.load).max(axis=1)


def _plate(scene: Scene, rng: np.random.Generator) -> None:
    """The root on springs, a plate right below, at a gap that may be next to nothing."""
    _springs(scene, rng)
    scene.plate = float(scene.body.vertices[:, 2].min() - REACH * 10 ** rng.uniform(-7, 0))
    scene.load[:, 2] = -np.abs(scene.load).max(axis=1)


def _free(scene: Scene, rng: np.random.Generator) -> None:
    """Nothing holds the bar."""
    scene.supported = False


def _sliding(scene: Scene, rng: np.random.Generator) -> None:
    """The bar lies on a plane, and a load pushes it along."""
    _planes(scene, rng)
    _drop_springs(scene)
    scene.load[:, 0] += np.abs(scene.load).max()
    scene.supported = False


def _stray(scene: Scene, rng: np.random.Generator) -> None:
    """The bar is constrained, a tet beside it is not."""
    body, count = scene.body, len(scene.body.vertices)
    corner = np.concatenate([np.zeros((1, 3)), np.eye(3)]) + [20.0, 0.0, 0.0]
    tets = np.concatenate([body.tets, [[count, count + 1, count + 2, count + 3]]])
    scene.body = Body(np.concatenate([body.vertices, corner]), tets, body.triangles)
    scene.young = np.append(scene.young, scene.young[0])
    scene.load = np.concatenate([scene.load, np.full((4, 3), np.abs(scene.load).max())])
    scene.spring_points = scene.plane_points = sp.csr_matrix((0, count + 4))
    _springs(scene, rng)
    scene.supported = False


def _drop_springs(scene: Scene) -> None:
    scene.spring_points = scene.spring_points[:0]
    scene.targets, scene.spring_stiffness = np.zeros((0, 3)), np.zeros(0)


_BUILD = {
    "springs": _springs,
    "slivers": _springs,
    "embedded": _embedded,
    "prestressed": _prestressed,
    "two": _two,
    "planes": _planes,
    "plate": _plate,
    "free": _free,
    "sliding": _sliding,
    "stray": _stray,
}
