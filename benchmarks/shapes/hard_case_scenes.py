"""Templates, marks and attachments of the hard cases, and the shapes that they come from.

True shapes come from closed-form maps, which know nothing of strains or elasticity.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.shapes.bodies import bar, farthest, liver, scattered
from benchmarks.shapes.organs import grown_liver
from handpipe.core import Array, IntArray
from handpipe.mesh.tets import TetMesh
from handpipe.shapes.observations.marks import Pairs
from handpipe.shapes.optimisation.settings import OrganSettings

SIZE = 22.0  # mm, about half of the organ's length
NONE = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True)
class Bars:
    """What is asked: distances of the whole surface in mm, mean and largest; the smallest dihedral angle's
    share of the template's; unsettled: nobody can know the shape, and a good fit must say so.
    """

    mean: float = 0.2
    largest: float = 1.5
    dihedral: float = 0.3
    unsettled: bool = False


@dataclass(frozen=True)
class Scene:
    """A template, the true shape on its tets, marks (r, 3) and what else is known; wrong_marks,
    wrong_attachments: which of these are not of the true shape.
    """

    mesh: TetMesh
    truth: TetMesh
    marks: Array
    attachments: Pairs | None = None
    settings: OrganSettings = field(default_factory=OrganSettings)
    wrong_marks: IntArray = field(default_factory=lambda: NONE)
    wrong_attachments: IntArray = field(default_factory=lambda: NONE)


@dataclass(frozen=True)
class Case:
    """A scene made with tets of about so many mm, and what is asked of its fit."""

    what: str
    scene: Callable[[float], Scene]
    bars: Bars = field(default_factory=Bars)


def plain(edge: float, marks: int = 100) -> Scene:
    """The organ, another person's, marks all over it."""
    mesh = liver(edge, SIZE)
    truth = grown_liver(mesh)
    return Scene(mesh, truth, scattered(truth.boundary(), marks))


def contradicting(edge: float) -> Scene:
    """Every other mark on a surface 15 % larger than the others'; the truth is half-way."""
    mesh = liver(edge, SIZE)
    truth = grown_liver(mesh)
    centre = truth.vertices.mean(axis=0)
    marks = scattered(truth.boundary(), 100)
    marks[::2] = centre + 1.075 * (marks[::2] - centre)
    marks[1::2] = centre + 0.925 * (marks[1::2] - centre)
    return Scene(mesh, truth, marks, wrong_marks=np.arange(len(marks)))


def half(edge: float) -> Scene:
    """No marks on one half; points in three places are known there as everywhere."""
    found = attached(edge, 6)
    seen = found.marks[found.marks[:, 0] > np.median(found.truth.vertices[:, 0])]
    return replace(found, marks=seen)


def threefold(edge: float) -> Scene:
    """Grown three times in one direction, which is turned along the organ."""
    mesh = liver(edge, SIZE)
    x, y, z = mesh.vertices.T
    turn = 0.3 * x / SIZE
    y, z = np.cos(turn) * y - np.sin(turn) * z, np.sin(turn) * y + np.cos(turn) * z
    truth = mesh.moved(np.column_stack([x, 3.0 * y, z]))
    return Scene(mesh, truth, scattered(truth.boundary(), 200))


def turned(axis: str) -> Callable[[float], Scene]:
    """The truth is turned by 90 degrees about an axis, and far away."""
    turn = Rotation.from_euler(axis, 90, degrees=True).as_matrix()

    def scene(edge: float) -> Scene:
        found = plain(edge)
        return replace(
            found,
            truth=found.truth.moved(found.truth.vertices @ turn.T + 3 * SIZE),
            marks=found.marks @ turn.T + 3 * SIZE,
        )

    return scene


def attached(edge: float, count: int) -> Scene:
    """Surface points are attached."""
    found = plain(edge)
    chosen = _spread_vertices(found.mesh, count)
    pairs = Pairs(found.mesh.vertices[chosen], found.truth.vertices[chosen])
    return replace(found, attachments=pairs)


def attachment_off(count: int, distance: float = 10.0) -> Callable[[float], Scene]:
    """One of so many attachments is so far off, mostly along the surface."""

    def scene(edge: float) -> Scene:
        found = attached(edge, count)
        assert found.attachments is not None
        targets = found.attachments.targets.copy()
        targets[1] += distance * np.array([0.6, 0.64, 0.48])
        pairs = Pairs(found.attachments.points, targets)
        return replace(found, attachments=pairs, wrong_attachments=np.array([1]))

    return scene


def outliers(share: float, leave_out: bool) -> Callable[[float], Scene]:
    """A share of the marks is from 3 to 10 mm off in any direction."""

    def scene(edge: float) -> Scene:
        found = plain(edge)
        rng = np.random.default_rng(1)
        wrong = rng.choice(len(found.marks), round(share * len(found.marks)), replace=False)
        shift = rng.standard_normal((len(wrong), 3))
        shift *= rng.uniform(3.0, 10.0, (len(wrong), 1)) / np.linalg.norm(shift, axis=1, keepdims=True)
        marks = found.marks.copy()
        marks[wrong] += shift
        return replace(found, marks=marks, wrong_marks=wrong, settings=OrganSettings(outliers=leave_out))

    return scene


def flat(edge: float) -> Scene:
    """A disc 1.5 mm thick and 40 mm long, bent by 60 degrees and grown: farther than it is thick."""
    cells = (round(40 / edge), round(24 / edge), 2)
    box = bar(cells, (2.0, 2.0, 1.5))
    u, v, z = (box.vertices - [1.0, 1.0, 0.75]).T
    disc = np.column_stack([20.0 * u * np.sqrt(1 - v**2 / 2), 12.0 * v * np.sqrt(1 - u**2 / 2), z])
    mesh = TetMesh(disc, box.tets).checked("disc")
    x, y, z = mesh.vertices.T
    angle = np.radians(60) * x / 40
    radius = 40 / np.radians(60)
    bent = np.column_stack(
        [(radius + z) * np.sin(angle), y * (1.15 + 0.1 * x / 20), (radius + z) * np.cos(angle)]
    )
    truth = mesh.moved(bent - [0, 0, radius])
    return Scene(mesh, truth, scattered(truth.boundary(), 150))


def slivers(edge: float) -> Scene:
    """A tenth of the inner vertices moved until one of their tets is next to flat."""
    found = plain(edge)
    mesh = _with_slivers(found.mesh)
    return replace(found, mesh=mesh, truth=grown_liver(mesh))


def collinear(off: float, error: float) -> Callable[[float], Scene]:
    """Three attachments at most `off` mm beside a line, the truth turned about it by 25 degrees, and their
    places known to `error` mm.
    """

    def scene(edge: float) -> Scene:
        found = plain(edge)
        beside = off * np.array([[0.0, 0, 0], [0, 1, 0], [0, 0, 1]])
        points = np.array([[-0.6, 0.1, 0.0], [0.0, 0.1, 0.0], [0.6, 0.1, 0.0]]) * SIZE + beside
        places = Pairs(points, points).attached(found.mesh).matrix @ found.truth.vertices
        turn, centre = _turn_about(places[2] - places[0], 25), places[0]
        shifts = np.random.default_rng(2).standard_normal((3, 3))
        shifts *= error / np.linalg.norm(shifts, axis=1, keepdims=True)
        return replace(
            found,
            truth=found.truth.moved((found.truth.vertices - centre) @ turn.T + centre),
            marks=(found.marks - centre) @ turn.T + centre,
            attachments=Pairs(points, (places - centre) @ turn.T + centre + shifts),
        )

    return scene


def _turn_about(axis: Array, degrees: float) -> Array:
    return Rotation.from_rotvec(np.radians(degrees) * axis / np.linalg.norm(axis)).as_matrix()


def _spread_vertices(mesh: TetMesh, count: int) -> IntArray:
    """Vertices of the boundary, far from one another."""
    outer = mesh.boundary_vertices()
    points = farthest(mesh.vertices[outer], count)
    return np.array([outer[np.abs(mesh.vertices[outer] - p).sum(axis=1).argmin()] for p in points])


def _with_slivers(mesh: TetMesh) -> TetMesh:
    """A tenth of the inner vertices go in a random direction until a tet has 2 % of its volume left."""
    rng = np.random.default_rng(3)
    inner = np.setdiff1d(np.arange(len(mesh.vertices)), mesh.boundary_vertices())
    x = mesh.vertices.copy()
    for vertex in rng.choice(inner, len(inner) // 10, replace=False):
        tets = mesh.tets[(mesh.tets == vertex).any(axis=1)]
        before = TetMesh(x, tets).volumes()
        direction = rng.standard_normal(3)
        x[vertex] += direction
        rate = before - TetMesh(x, tets).volumes()  # volumes are linear in one vertex
        longest = (before[rate > 0] / rate[rate > 0]).min()
        x[vertex] += (0.98 * longest - 1.0) * direction
    return TetMesh(x, mesh.tets).checked("slivers")


EASY = Bars(mean=0.15, largest=1.0)

CASES: dict[str, Case] = {
    "plain": Case("for comparison: 100 marks all over, nothing else wrong", plain),
    "contradicting": Case(
        "half of the marks on a surface 15 % larger than the others'; truth: the middle",
        contradicting,
        Bars(mean=0.5, unsettled=True),
    ),
    "half-unmarked": Case(
        "half of the organ without marks; six attachments", half, Bars(mean=0.5, largest=2.5)
    ),
    "threefold": Case("3 times longer in one direction that turns along the organ; free", threefold),
    "turned-x": Case("turned by 90 degrees about its long axis and far away; free", turned("x")),
    "turned-z": Case("turned by 90 degrees about its short axis and far away; free", turned("z")),
    "attachment-off-4": Case("one of 4 attachments 10 mm off", attachment_off(4)),
    "attachment-off-8": Case("one of 8 attachments 10 mm off", attachment_off(8)),
    "attachment-off-24": Case("one of 24 attachments 10 mm off", attachment_off(24)),
    "outliers-5": Case("5 of 100 marks 3 to 10 mm off, left out", outliers(0.05, True)),
    "outliers-20": Case("20 of 100 marks 3 to 10 mm off, left out", outliers(0.2, True)),
    "outliers-20-trusted": Case("the same, all trusted", outliers(0.2, False), Bars(unsettled=True)),
    "flat": Case("disc 1.5 mm thick, bent by 60 degrees and grown; free", flat),
    "slivers": Case("template with slivers, smallest dihedral angle below 1 degree", slivers),
    "collinear": Case("three attachments on a line, turned by 25 degrees about it", collinear(0.0, 0.0)),
    "nearly-collinear": Case(
        "three attachments 0.5 mm off a line, places known to 0.3 mm, turned by 25 degrees",
        collinear(0.5, 0.3),
    ),
}
