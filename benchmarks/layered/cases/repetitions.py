"""The same frame by another way: other starts, other company, other places, nearly the same angles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.layered.case import Case, Check, Outcome, Solved
from benchmarks.layered.measures import change, skin_of
from benchmarks.layered.subject import PLAIN, Subject, simulated
from handpipe.core import Array, Frame, RigidTransform
from handpipe.hand import simulate
from handpipe.tissues.fat.layer import TissueLayer

SAME = 0.05  # mm
NOISE = 0.1  # mm of a start, a coordinate
LEVER = 2.0  # times a bone's motion that skin may move


class _From(TissueLayer):
    """The fat from a given start (n, 3)."""

    def __init__(self, layer: TissueLayer, start: Array) -> None:
        super().__init__(layer.name, layer.tissue, layer.strains)
        self.start = start

    def starts(self, bones: object) -> list[Array]:  # noqa: ARG002
        return [self.start]


def _started(start: Callable[[Subject, TissueLayer], Array]) -> Callable[[Subject], Outcome]:
    """The plain frame with its fat from another start."""

    def run(subject: Subject) -> Outcome:
        fat = subject.layers["fat"]
        assert isinstance(fat, TissueLayer)
        other = _From(fat, start(subject, fat))
        known = {name: shapes for name, shapes in subject.plain_shapes.items() if name != "fat"}
        found = Solved(subject.plain, [other], known | {"fat": other.solve(subject.plain, known)})
        apart = float(change(found.shapes, subject.plain_shapes).max())
        return Outcome([found], [Check("skin from that of the usual start", apart, SAME)])

    return run


def _of_bones(subject: Subject, fat: TissueLayer) -> Array:
    return fat.starts(subject.plain.bones)[-1]


def _of_pose(share: float) -> Callable[[Subject, TissueLayer], Array]:
    """The fat's vertices in the frame whose flexions are at another share of their limits."""

    def start(subject: Subject, fat: TissueLayer) -> Array:
        shapes = simulated(subject.frame("start", subject.bent(share)), subject.whole())
        return shapes["fat"]["fat_mesh"].vertices

    return start


def _shaken(subject: Subject, fat: TissueLayer) -> Array:
    at_rest = fat.starts(subject.plain.bones)[0]
    return at_rest + NOISE * np.random.default_rng(0).normal(size=at_rest.shape)


def _in_company(subject: Subject) -> Outcome:
    """The plain frame first, last and between others; the same bits."""
    layers = subject.whole()
    others = [subject.frame(str(share), subject.bent(share)) for share in (0.2, 0.3)]
    [first, second] = others
    orders: Sequence[Sequence[Frame]] = ([first, subject.plain, second], [second, subject.plain, first])
    runs = [{f.name: shapes for f, shapes in simulate(order, layers).frames} for order in orders]
    alone = subject.plain_shapes
    apart = max(float(change(run["plain"], alone).max(initial=0.0)) for run in runs)
    across = max(float(change(runs[0][f.name], runs[1][f.name]).max()) for f in others)
    checks = [
        Check("skin in a sequence from that of the frame alone", apart, 0.0),
        Check("skins forwards and backwards", across, 0.0),
    ]
    return Outcome([Solved(subject.plain, layers, subject.plain_shapes)], checks)


def _nearly(degrees: float, limit: float) -> Callable[[Subject], Outcome]:
    def run(subject: Subject) -> Outcome:
        angles = {n: a + np.radians(degrees) for n, a in subject.bent(PLAIN).items()}
        found = Solved.of(subject.frame("case", angles), subject.whole())
        apart = float(change(found.shapes, subject.plain_shapes).max())
        return Outcome([found], [Check("skin from that of the plain frame", apart, limit)])

    return run


def _a_degree(subject: Subject) -> Outcome:
    angles = {n: a + np.radians(1.0) for n, a in subject.bent(PLAIN).items()}
    found = Solved.of(subject.frame("case", angles), subject.whole())
    bones = max(
        float(change(found.shapes, subject.plain_shapes, "bones", bone).max()) for bone in subject.bones
    )
    apart = float(change(found.shapes, subject.plain_shapes).max())
    return Outcome([found], [Check("skin from that of the plain frame", apart, LEVER * bones)])


def _elsewhere(subject: Subject) -> Outcome:
    """All bones turned by 120 degrees and moved by half a metre: the skin goes with them."""
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    motion = RigidTransform(turn, np.array([500.0, -200.0, 100.0]))
    frame = replace(subject.plain, bones={n: motion @ t for n, t in subject.plain.bones.items()})
    found = Solved.of(frame, subject.whole())
    moved, plain = skin_of(found.shapes), skin_of(subject.plain_shapes)
    assert moved is not None and plain is not None
    apart = float(np.linalg.norm(moved.vertices - motion(plain.vertices), axis=1).max())
    check = Check("skin from the moved skin of the plain frame", apart, SAME)
    return Outcome([found], [check], same_pose=False)


CASES = [
    Case("start-neighbour", "plain, from a pose 5 % more bent", _started(_of_pose(PLAIN + 0.05))),
    Case("start-half", "plain, from a pose half as bent", _started(_of_pose(0.5 * PLAIN))),
    Case(
        "start-bones",
        "plain, from the blend of the bones",
        _started(_of_bones),
    ),
    Case("start-shaken", "plain, from a start with 0.1 mm of noise", _started(_shaken)),
    Case("company", "plain alone, in a sequence, backwards", _in_company),
    Case("duplicate", "plain, every angle 10⁻⁶ deg larger", _nearly(1e-6, 1e-3)),
    Case("near-duplicate", "plain, every angle 0.01 deg larger", _nearly(1e-2, SAME)),
    Case("degree", "plain, every angle 1 deg larger", _a_degree),
    Case("elsewhere", "plain, the limb turned by 120 deg and moved by half a metre", _elsewhere),
]
