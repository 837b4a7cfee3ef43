"""Layers that are missing, changed in size, or meshed otherwise."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from benchmarks.layered.case import Case, Check, Outcome, Solved
from benchmarks.layered.measures import change, distances, skin_of
from benchmarks.layered.subject import Subject, simulated
from handpipe.core import Shapes, under_fat
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.posing import smoothed_weights
from handpipe.stages.tissues.tissue import SKIN_THICKNESS
from handpipe.tissues.fat import Tissue, inner_points, inner_surface, skin_share, tissue_mesh
from handpipe.tissues.fat.layer import TissueLayer
from handpipe.tissues.muscles import Muscle, MuscleLayer
from handpipe.tissues.tendons.layer import TendonLayer

MODELS = 2.0  # mm, mean, between models of the skin
MESHES = 0.5  # mm, mean, between meshes of one tissue
SPACING, GAP, SLACK = 0.8, 1.0, 0.25  # mm of the tissue's inner surface, as the stage has them
THINNER, COARSER, LARGER = 0.5, 1.5, 2.0 ** (1 / 3)


def _without(*names: str) -> Callable[[Subject], Outcome]:
    """The plain frame without some layers; those that are left do not change by a bit."""

    def run(subject: Subject) -> Outcome:
        layers = [layer for layer in subject.whole() if layer.name not in names]
        found = Solved.of(subject.plain, layers)
        bodies = [(layer, body) for layer, shapes in found.shapes.items() for body in shapes]
        apart = max(
            float(change(found.shapes, subject.plain_shapes, layer, body).max()) for layer, body in bodies
        )
        return Outcome([found], [Check("all bodies from those of the whole limb", apart, 0.0)])

    return run


def _fewer_tendons(subject: Subject) -> Outcome:
    tendons = subject.layers["tendons"]
    assert isinstance(tendons, TendonLayer)
    kept = TendonLayer([*tendons.tendons.values()][1:])
    return Outcome([Solved.of(subject.plain, subject.whole(tendons=kept))])


def _fewer_muscles(subject: Subject) -> Outcome:
    muscles = subject.layers["muscles"]
    assert isinstance(muscles, MuscleLayer)
    kept = MuscleLayer(muscles.muscles[1:])
    return Outcome([Solved.of(subject.plain, subject.whole(muscles=kept))])


def _one_tissue(subject: Subject) -> Outcome:
    found = Solved.of(subject.plain, [subject.layers["bones"], subject.layers["skin"]])
    return Outcome([found], [_skin_change(subject, found, MODELS)])


def _no_strains(subject: Subject) -> Outcome:
    found = Solved.of(subject.plain, subject.whole(fat=_bare(subject)))
    return Outcome([found], [_skin_change(subject, found, MODELS)])


def _skin_change(subject: Subject, found: Solved, limit: float) -> Check:
    apart = float(change(found.shapes, subject.plain_shapes).mean())
    return Check("skin from that of the whole limb, mean", apart, limit)


def _bare(subject: Subject) -> TissueLayer:
    """The fat without plastic strains."""
    fat = subject.layers["fat"]
    assert isinstance(fat, TissueLayer)
    return fat.without_strains()


def _thin(subject: Subject) -> Outcome:
    """Each skin vertex half as far from the nearest body below, meshed anew, without strains."""
    below, tissue = _neutral(subject), _bare(subject).tissue
    inner = inner_surface(_bodies(below), SPACING, GAP)
    skin = tissue.skin
    _, places = _closest(skin.vertices, inner)
    thin = skin.moved(skin.vertices + (1 - THINNER) * (places - skin.vertices))
    made = _meshed(subject, below, replace(tissue, skin=thin), inner, 1.0)
    found = Solved.of(subject.plain, subject.whole(fat=made))
    before, after = (_thickness(s) for s in (subject.plain_shapes, found.shapes))
    return Outcome([found], [Check("median thickness over the whole limb's", after / before, 0.75, "1")])


def _coarse(subject: Subject) -> Outcome:
    """Tets of edges half as long again, without strains, against the usual ones without strains."""
    below, bare = _neutral(subject), _bare(subject)
    inner = inner_surface(_bodies(below), SPACING, GAP)
    made = _meshed(subject, below, bare.tissue, inner, COARSER)
    found = Solved.of(subject.plain, subject.whole(fat=made))
    usual = Solved.of(subject.plain, subject.whole(fat=bare))
    apart = float(change(found.shapes, usual.shapes).mean())
    return Outcome([found], [Check("skin from that on the usual mesh, mean", apart, MESHES)])


def _neutral(subject: Subject) -> dict[str, Shapes]:
    layers = [layer for layer in subject.whole() if layer.name != "fat"]
    return simulated(subject.frame("neutral", subject.bent(0.0)), layers)


def _bodies(below: Mapping[str, Shapes]) -> list[Surface]:
    shapes = [s for n in under_fat() for s in below.get(n, {}).values() if s.cells.shape[1] == 3]
    return [Surface(s.vertices, s.cells) for s in shapes]


def _meshed(
    subject: Subject, below: Mapping[str, Shapes], tissue: Tissue, inner: Surface, coarser: float
) -> TissueLayer:
    """The fat of a skin meshed anew, with tets of the usual size times `coarser`."""
    edge = coarser * tissue.mesh.edge_length()
    mesh, occupancy = tissue_mesh(tissue.skin, inner, edge)
    layers = tuple(name for name in under_fat() if name in below)
    made = replace(
        tissue,
        mesh=mesh,
        occupancy=occupancy,
        inner=inner_points(below, layers, inner, slack=SLACK),
        weights=smoothed_weights(mesh, subject.bones),
        skin_share=skin_share(mesh, tissue.skin, inner, SKIN_THICKNESS),
    )
    return TissueLayer("fat", made)


def _closest(points: np.ndarray, surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    away, _, places = Distance(surface).closest(points)
    return away, places


def _thickness(shapes: Mapping[str, Shapes]) -> float:
    """Median distance in mm of the skin's vertices from the nearest body below."""
    skin = skin_of(shapes)
    assert skin is not None
    each = [distances(skin.vertices, s.vertices, s.triangles) for s in _bodies(shapes)]
    return float(np.median(np.min(each, axis=0)))


def _larger_muscle(subject: Subject) -> Outcome:
    """The first muscle with twice its volume, about its middle; attachments grow with it."""
    muscles = subject.layers["muscles"]
    assert isinstance(muscles, MuscleLayer)
    first, *others = muscles.muscles
    swollen = MuscleLayer([_scaled(first, LARGER), *others])
    layers = [
        layer for layer in subject.whole(muscles=swollen) if layer.name in ("bones", "flesh", "muscles")
    ]
    found = Solved.of(subject.plain, layers)
    volumes = [
        abs(Surface(s["muscles"][first.name].vertices, s["muscles"][first.name].cells).volume())
        for s in (subject.plain_shapes, found.shapes)
    ]
    ratio = volumes[1] / volumes[0]
    return Outcome([found], [Check("volume over the usual muscle's, from 2", abs(ratio - 2.0), 0.5, "1")])


def _scaled(muscle: Muscle, factor: float) -> Muscle:
    body = muscle.body
    middle = body.mesh.vertices.mean(axis=0)

    def scaled(points: np.ndarray) -> np.ndarray:
        return middle + factor * (points - middle)

    shift = scaled(body.mesh.vertices) - body.mesh.vertices
    grown = replace(
        body,
        surface=body.surface.moved(scaled(body.surface.vertices)),
        mesh=body.mesh.moved(scaled(body.mesh.vertices)),
    )
    means = muscle.vertices.mean(axis=1, keepdims=True)
    bed = muscle.bed and replace(muscle.bed, beside=muscle.bed.beside + shift)
    return replace(muscle, body=grown, vertices=means + factor * (muscle.vertices - means), bed=bed)


CASES = [
    Case("no-fat", "plain, all layers under the fat alone", _without("fat")),
    Case("muscles-only", "plain, bones and muscles alone", _without(
        "bone_fascia", "tendons", "muscle_fascia", "ligaments", "fat"
    )),
    Case("no-fascia", "plain, fat that was built on a muscle fascia, without it", _without("muscle_fascia"),
         named="muscle_fascia"),
    Case("no-tendon", "plain, fat that was built on two tendons, one of them missing", _fewer_tendons,
         named="tendons"),
    Case("no-muscle", "plain, a muscle fascia that was built on two muscles, one of them missing",
         _fewer_muscles, named="muscles"),
    Case("one-tissue", "plain, bones in one soft tissue", _one_tissue),
    Case("no-strains", "plain, the fat without plastic strains", _no_strains),
    Case("thin-fat", "plain, half as much fat between the skin and what is below", _thin),
    Case("coarse-fat", "plain, tets of the fat with edges half as long again", _coarse),
    Case("larger-muscle", "plain, bones and muscles, one muscle of twice its volume", _larger_muscle,
         named=""),
]  # fmt: skip
