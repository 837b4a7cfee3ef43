"""Stiffnesses and Poisson's ratios far from the usual ones.

For a total k W + C of an elastic energy W per modulus and all else C, the W of a minimum falls as k grows. If
all forces of a layer are scaled by one factor, its shape does not change.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from benchmarks.layered.case import Case, Check, Outcome, Solved
from benchmarks.layered.measures import change
from benchmarks.layered.subject import Subject
from benchmarks.trust.frames import volume_ratios
from handpipe.core import Array, Shapes
from handpipe.fem.elements import Material
from handpipe.fem.potentials import Elastic
from handpipe.tissues.fascia.layer import FasciaLayer
from handpipe.tissues.fat.layer import TissueLayer
from handpipe.tissues.muscles import MuscleLayer
from handpipe.tissues.tendons.fitting.motion import Bones
from handpipe.tissues.tendons.layer import TendonLayer
from handpipe.tissues.tendons.rods.energies import Hooks, RodEnergy
from handpipe.tissues.tendons.tendon import Tendon

SOFT, STIFF = 0.01, 100.0
SLACK = 1.01  # of an energy: planes of contact differ
SAME = 0.02  # mm
FASCIA = 0.5  # mm, mean, of the skin: a fascia carries no load but its own


def _fat(subject: Subject, **settings: float) -> TissueLayer:
    """The fat with some of its settings replaced."""
    fat = subject.layers["fat"]
    assert isinstance(fat, TissueLayer)
    tissue = replace(fat.tissue, settings=replace(fat.tissue.settings, **settings))
    return TissueLayer("fat", tissue, fat.strains)


def _settings(subject: Subject) -> Mapping[str, float]:
    fat = subject.layers["fat"]
    assert isinstance(fat, TissueLayer)
    return vars(fat.tissue.settings)


def _stiffer_fat(subject: Subject, factor: float, *names: str) -> TissueLayer:
    """The fat with some of its settings times a factor."""
    usual = _settings(subject)
    return _fat(subject, **{name: factor * usual[name] for name in names})


def _muscles(subject: Subject, young: float = 1.0, other: float = 1.0) -> MuscleLayer:
    """The muscles with Young's modulus and all other stiffnesses times a factor."""
    usual = subject.layers["muscles"]
    assert isinstance(usual, MuscleLayer)
    options, material = usual.options, usual.options.material
    changed = replace(
        options,
        material=Material(young * np.asarray(material.young), material.poisson, material.model),
        **{name: other * getattr(options, name) for name in ("spring", "bed", "contact", "sliding")},
    )
    made = MuscleLayer(usual.muscles, changed)
    made.contacts = replace(usual.contacts, options=changed)
    return made


def _energy(bodies: Mapping[str, Elastic], shapes: Shapes) -> float:
    """Elastic energy over the modulus in mm^3, of all tets of a layer."""
    return sum(
        body.value(shapes[name].vertices) / float(np.max(np.asarray(body.material.young)))
        for name, body in bodies.items()
    )


def _softer(layer: str, factor: float) -> Callable[[Subject], Outcome]:
    """The fat or the muscles with another Young's modulus."""

    def run(subject: Subject) -> Outcome:
        if layer == "fat":
            changed: TissueLayer | MuscleLayer = _stiffer_fat(subject, factor, "young", "skin_young")
        else:
            changed = _muscles(subject, young=factor)
        found = Solved.of(subject.plain, subject.whole(**{layer: changed}))
        usual = subject.layers[layer]
        assert isinstance(usual, TissueLayer | MuscleLayer)
        before = _energy(usual.elastic_bodies(subject.plain.bones), subject.plain_shapes[layer])
        after = _energy(changed.elastic_bodies(subject.plain.bones), found.shapes[layer])
        ratio = after / before if factor > 1 else before / after
        check = Check("elastic energy over modulus, stiffer over softer", ratio, SLACK, "1")
        return Outcome([found], [check])

    return run


def _scaled_fat(factor: float) -> Callable[[Subject], Outcome]:
    def run(subject: Subject) -> Outcome:
        changed = _stiffer_fat(subject, factor, "young", "skin_young", "stiffness")
        found = Solved.of(subject.plain, subject.whole(fat=changed))
        apart = float(change(found.shapes, subject.plain_shapes).max())
        return Outcome([found], [Check("skin from the usual one", apart, SAME)])

    return run


def _scaled_muscles(subject: Subject) -> Outcome:
    found = Solved.of(subject.plain, subject.whole(muscles=_muscles(subject, STIFF, STIFF)))
    usual = subject.plain_shapes
    apart = max(float(change(found.shapes, usual, "muscles", name).max()) for name in usual["muscles"])
    return Outcome([found], [Check("muscles from the usual ones", apart, SAME)])


def _fasciae(factor: float) -> Callable[[Subject], Outcome]:
    def run(subject: Subject) -> Outcome:
        changed = {}
        for name in ("bone_fascia", "muscle_fascia"):
            layer = subject.layers[name]
            assert isinstance(layer, FasciaLayer)
            settings = replace(layer.fascia.settings, young=factor * layer.fascia.settings.young)
            changed[name] = FasciaLayer(replace(layer.fascia, settings=settings), layer.over)
        found = Solved.of(subject.plain, subject.whole(**changed))
        areas = [_area(shapes) for shapes in (subject.plain_shapes, found.shapes)]
        ratio = areas[1] / areas[0] if factor > 1 else areas[0] / areas[1]
        apart = float(change(found.shapes, subject.plain_shapes).mean())
        checks = [
            Check("area of the shrunk cloths, stiffer over softer", ratio, SLACK, "1"),
            Check("skin from the usual one, mean", apart, FASCIA),
        ]
        return Outcome([found], checks)

    return run


def _area(shapes: Mapping[str, Shapes]) -> float:
    found = 0.0
    for name in ("bone_fascia", "muscle_fascia"):
        shape = shapes[name][name]
        a, b, c = np.moveaxis(shape.vertices[shape.cells], 1, 0)
        found += 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    return found


class _Tight(Tendon):
    """A tendon whose pull and bending are 100 times as large against its hooks."""

    def energies(self, bones: Bones, flesh: Array | None = None) -> list[RodEnergy]:
        hooks, *others = super().energies(bones, flesh)
        assert isinstance(hooks, Hooks)
        return [Hooks(hooks.points, hooks.weights / STIFF), *others]


def _tightened(tendon: Tendon) -> Tendon:
    return _Tight(*(getattr(tendon, name) for name in tendon.__dataclass_fields__))


def _tight_tendons(subject: Subject) -> Outcome:
    usual = subject.layers["tendons"]
    assert isinstance(usual, TendonLayer)
    tight = TendonLayer(map(_tightened, usual.tendons.values()))
    found = Solved.of(subject.plain, subject.whole(tendons=tight))
    checks = []
    for name, tendon in usual.tendons.items():
        direction = subject.plain.bones[tendon.rest.bones[-1]].rotation @ tendon.rest.pull_direction
        ends = [
            s["tendons"][f"{name}_centreline"].vertices[-1] @ direction
            for s in (subject.plain_shapes, found.shapes)
        ]
        checks.append(Check(f"{name}: end behind that of the usual pull", float(ends[0] - ends[1]), 0.01))
    return Outcome([found], checks)


def _poisson(ratio: float) -> Callable[[Subject], Outcome]:
    """The fat with another Poisson's ratio: the nearer to 0.5, the less its volume changes."""

    def run(subject: Subject) -> Outcome:
        changed = _fat(subject, poisson=ratio)
        found = Solved.of(subject.plain, subject.whole(fat=changed))
        usual, now = (_volume_change(subject, s) for s in (subject.plain_shapes, found.shapes))
        stiffer = ratio > _settings(subject)["poisson"]
        share = now / usual if stiffer else usual / now
        return Outcome([found], [Check("volume change, stiffer over softer", share, SLACK, "1")])

    return run


def _volume_change(subject: Subject, shapes: Mapping[str, Shapes]) -> float:
    """Root mean square of det(F_e) - 1 over the fat's tissue."""
    fat, mesh = subject.layers["fat"], shapes["fat"]["fat_mesh"]
    assert isinstance(fat, TissueLayer)
    strains = fat.plastic_strains(subject.plain.bones)
    plastic = 1.0
    if strains is not None:
        plastic = np.linalg.det(np.asarray(strains)[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]])
    ratios = volume_ratios(mesh.rest, mesh.vertices, mesh.cells) / plastic
    weights = fat.tissue.occupancy * fat.tissue.mesh.volumes() * plastic
    return float(np.sqrt(np.average((ratios - 1) ** 2, weights=weights)))


def _refused_fat(**settings: float) -> Callable[[Subject], Outcome]:
    return lambda subject: Outcome([Solved.of(subject.plain, subject.whole(fat=_fat(subject, **settings)))])


CASES = [
    Case("fat-soft", "plain, the fat 100 times softer", _softer("fat", SOFT)),
    Case("fat-stiff", "plain, the fat 100 times stiffer", _softer("fat", STIFF)),
    Case("fat-scaled-down", "plain, the fat and its constraints 100 times softer", _scaled_fat(SOFT)),
    Case("fat-scaled-up", "plain, the fat and its constraints 100 times stiffer", _scaled_fat(STIFF)),
    Case("muscle-soft", "plain, muscles 100 times softer", _softer("muscles", SOFT)),
    Case("muscle-stiff", "plain, muscles 100 times stiffer", _softer("muscles", STIFF)),
    Case("muscle-scaled-up", "plain, muscles, their springs and contact 100 times stiffer", _scaled_muscles),
    Case("fascia-soft", "plain, fasciae 100 times softer", _fasciae(SOFT)),
    Case("fascia-stiff", "plain, fasciae 100 times stiffer", _fasciae(STIFF)),
    Case("tendon-tight", "plain, pull and bending of tendons 100 times as large", _tight_tendons),
    Case("poisson-0.3", "plain, the fat's Poisson's ratio 0.3", _poisson(0.3)),
    Case("poisson-0.499", "plain, the fat's Poisson's ratio 0.499", _poisson(0.499)),
    Case("poisson-0.49999", "plain, the fat's Poisson's ratio 0.49999", _poisson(0.49999)),
    Case("poisson-0.5", "plain, the fat's Poisson's ratio 0.5", _refused_fat(poisson=0.5), named="poisson"),
    Case("young-zero", "plain, the fat's Young's modulus 0", _refused_fat(young=0.0), named="young"),
]  # fmt: skip
