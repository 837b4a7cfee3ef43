"""Stage 1: the shape of one muscle in one pose, from the image of that pose.

The method is that of Zheng 2022 §4.2 and Wang 2021 §6.1.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np
from scipy import sparse

from handpipe.core import Array, BoolArray, ConvergenceError, IntArray, Metrics, RigidTransform, Shape
from handpipe.imaging.evidence import MarkerSettings, boundary_markers, estimate_muscle_level
from handpipe.imaging.volumes import Volume
from handpipe.mesh.surfaces import Distance, Surface, about, concatenate, each_moved
from handpipe.mesh.tets import Embedding, TetMesh
from handpipe.shapes.observations import Markers, fixed_markers
from handpipe.shapes.optimisation import (
    EmbeddedSurface,
    FindMarkers,
    KnownPoints,
    ShapeFit,
    ShapeOptions,
    fit_shape,
)
from handpipe.tissues.muscles.fitting.contraction import contracted, slack, taut
from handpipe.tissues.muscles.fitting.soft_body import ON_BONE, SoftBody
from handpipe.tissues.muscles.fitting.surroundings import carried_along
from handpipe.tissues.muscles.fitting.template_placement import PlacedTemplate

log = logging.getLogger(__name__)

# Further out than 2 mm lie the far sides of neighbours.
SEARCH = MarkerSettings.model_validate({"search": 2.0})
TOUCHING, NEAR = 0.3, 0.5  # mm from a neighbour, where only edges this near belong to the muscle itself
WITHIN = 0.3  # mm inside a bone up to which a muscle's boundary counts as touching the bone
SPREADS = (0.0, 0.25, 0.5, 0.75, 1.0)  # shares of harmonic weights in the blends that are tried
SEEN = 0.9  # share of its boundary in the image from which no other guess is tried
DOUBTED = 0.8  # share below which part of a muscle may lie beside itself
TRUSTED = 0.5  # share from which a fit tells how the muscles around it have moved
ALIKE = 0.3  # mm of mean distance under which one of two guesses is dropped
# In neutral the template is known roughly: a little weight keeps from wandering what no image shows, strains
# along a slender muscle and borders between muscles.
NEUTRAL = ShapeOptions(strain=0.01)
POSED = ShapeOptions(fields=(30, 60), volume=0.1, strain=0.03)  # only the bending is unknown
SAME_SIDE = 0.3  # cosine of the angle to a neighbour's normal, up to which an edge may be the neighbour's


@dataclass(frozen=True)
class PoseData:
    """What is known of all muscles in one example pose.

    Parameters
    ----------
    transforms : mapping of str to RigidTransform
        Transform of each bone from neutral into the volume's frame.
    volume : callable
        Reads the image.
    points : mapping of str to array (r, 3)
        Markers in mm that a person has placed, by muscle.
    landmarks : mapping of str to mapping of str to array (3,)
        Places in mm, by muscle and label.
    flesh : Shape, optional
        Soft tissue in the volume's frame, where it is known.
    """

    transforms: Mapping[str, RigidTransform]
    volume: Callable[[], Volume]
    points: Mapping[str, Array] = field(default_factory=dict)
    landmarks: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    flesh: Shape | None = None


@dataclass(frozen=True)
class Evidence:
    """What tells the shape of one muscle in one pose.

    Parameters
    ----------
    volume : Volume
        The image.
    others : sequence of Surface
        Approximate surfaces of the other muscles, in mm.
    bones : Distance, optional
        Distance from all bones, in mm.
    points : array (r, 3), optional
        Markers in mm that a person has placed; they replace those found in the image.
    landmarks : mapping of str to array (3,), optional
        Places in mm by label.
    """

    volume: Volume
    others: Sequence[Surface] = ()
    bones: Distance | None = None
    points: Array | None = None
    landmarks: Mapping[str, Array] | None = None

    def markers(self, body: SoftBody, settings: MarkerSettings | None) -> FindMarkers:
        """The placed markers, or those that the image shows."""
        if self.points is not None:
            return fixed_markers(self.points)
        return image_markers(self.volume, body, settings, self.others, self.bones)


@dataclass(frozen=True)
class Extraction:
    """A muscle in one pose, and how well it was found.

    Parameters
    ----------
    surface : Surface
        Surface in mm.
    vertices : array (n, 3)
        Mesh vertices in mm.
    fit : ShapeFit
        The fit.
    seen : float
        Share of the places where neutral shows the boundary at which this image shows it on the surface.
    """

    surface: Surface
    vertices: Array
    fit: ShapeFit
    seen: float

    def metrics(self) -> Metrics:
        """The last step's figures, and the number of steps."""
        last = self.fit.record[-1]
        return {
            "marker_error_mean": (last.marker_mean, "mm"),
            "marker_error_max": (last.marker_max, "mm"),
            "attachment_error_max": (last.attachment_max, "mm"),
            "strain_eigenvalue_min": (last.eigenvalue, "1"),
            "iterations": (float(len(self.fit.record)), "1"),
            "boundary_seen": (self.seen, "1"),
        }


def extract_neutral(
    guess: PlacedTemplate,
    evidence: Evidence,
    *,
    edge: float = 1.8,
    markers: MarkerSettings | None = None,
    options: ShapeOptions | None = None,
) -> tuple[SoftBody, Extraction]:
    """The neutral shape from a placed template, and the body that later stages deform.

    The body has new tetrahedra, since fitting has strained the first ones.

    Parameters
    ----------
    guess : PlacedTemplate
        Placed template.
    evidence : Evidence
        Evidence of the neutral pose, with guesses of the other muscles.
    edge : float
        Edge length of the tetrahedra in mm, about.
    markers : MarkerSettings, optional
        How the image is searched for the boundary.
    options : ShapeOptions, optional
        Weights and limits of the fit.

    Returns
    -------
    body : SoftBody
        The fitted surface, filled with new tetrahedra.
    extraction : Extraction
        The fit, with the vertices of the new tetrahedra in mm.
    """
    first = SoftBody.fill(guess.surface, guess.attachments, edge, guess.landmarks)
    still = {bone: RigidTransform.identity() for bone in guess.attachments}
    find, bones = evidence.markers(first, markers), evidence.bones
    extraction = _extract(first, still, first.mesh.vertices, find, options or NEUTRAL, evidence.landmarks)
    body = SoftBody.fill(extraction.surface, guess.attachments, edge, guess.landmarks)
    if bones is not None:
        body = replace(body, visible=body.visible | (bones.signed(body.surface.vertices)[0] >= ON_BONE))
    if evidence.points is None:
        found = evidence.markers(body, markers)(body.surface)
        assert found.vertices is not None
        body = replace(body, visible=_mostly(body.surface, found.vertices))
    return body, replace(extraction, vertices=body.mesh.vertices)


def extract_pose(
    body: SoftBody,
    bones: Mapping[str, Surface],
    transforms: Mapping[str, RigidTransform],
    evidence: Evidence,
    *,
    start: Array | None = None,
    markers: MarkerSettings | None = None,
    options: ShapeOptions | None = None,
) -> Extraction:
    """The shape in an example pose, from the neutral body attached to the moved bones where it lies on them.

    An end that lies on no bone is fixed where it is found.

    Parameters
    ----------
    body : SoftBody
        Neutral body.
    bones : mapping of str to Surface
        Neutral surfaces of the bones in mm.
    transforms : mapping of str to RigidTransform
        Transform of each bone from neutral into the volume's frame.
    evidence : Evidence
        Evidence of this pose.
    start : array (n, 3), optional
        Mesh vertices in mm of a better first guess, as simulated from poses already known.
    markers : MarkerSettings, optional
        How the image is searched for the boundary.
    options : ShapeOptions, optional
        Weights and limits of the fit.

    Returns
    -------
    Extraction
        The shape in the volume's frame.
    """
    x = body.follow(bones, transforms) if start is None else start
    attached = body.on_bones(bones)
    kept = attached.attachments
    loose = [body.matrix[ids] for bone, ids in body.attachments.items() if not len(kept[bone])]
    find = evidence.markers(attached, markers or SEARCH)
    return _extract(attached, transforms, x, find, options or POSED, evidence.landmarks, loose)


def extract_poses(
    bodies: Mapping[str, SoftBody],
    bones: Mapping[str, Surface],
    poses: Mapping[str, PoseData],
    *,
    markers: MarkerSettings | None = None,
    options: ShapeOptions | None = None,
) -> dict[str, dict[str, Extraction]]:
    """The shapes of all muscles in all example poses.

    The first guesses of a pose come from the flesh that carries the muscles there, where that is known, and
    from the most similar pose that is already fitted. Each muscle knows where its neighbours are.

    Parameters
    ----------
    bodies : mapping of str to SoftBody
        Neutral bodies by muscle.
    bones : mapping of str to Surface
        Neutral surfaces of the bones in mm.
    poses : mapping of str to PoseData
        What is known of each pose.
    markers : MarkerSettings, optional
        How images are searched for boundaries.
    options : ShapeOptions, optional
        Weights and limits of the fits.

    Returns
    -------
    dict of str to dict of str to Extraction
        Shapes by pose and muscle, in the frames of the poses' volumes.
    """
    still = {b: RigidTransform.identity() for b in bones}
    known: dict[str, tuple[Mapping[str, RigidTransform], dict[str, Array]]] = {}
    known[""] = (still, {m: b.mesh.vertices for m, b in bodies.items()})
    found: dict[str, dict[str, Extraction]] = {}
    fleshes = [data.flesh for data in poses.values() if data.flesh is not None]
    embeddings = _in_flesh(bodies, fleshes[0]) if fleshes else {}
    while len(found) < len(poses):
        left = [
            (_apart(poses[p].transforms, known[q][0], bodies), p, q)
            for p in poses
            if p not in found
            for q in known
        ]
        _, pose, near = min(left)
        log.info("%s: guessed from %s", pose, near or "neutral")
        data = poses[pose]
        moved, image = data.transforms, data.volume()
        there, placed = known[near]
        carried = {m: e(data.flesh.vertices) for m, e in embeddings.items()} if data.flesh is not None else {}
        guesses = {
            m: _unlike(_starts(carried.get(m), b, bones, moved, (there, placed[m]), image))
            for m, b in bodies.items()
        }
        found[pose] = _Pose(pose, bodies, bones, data, image, markers, options).fitted(guesses)
        known[pose] = moved, {m: e.vertices for m, e in found[pose].items()}
    return {pose: found[pose] for pose in poses}


def _in_flesh(bodies: Mapping[str, SoftBody], flesh: Shape) -> dict[str, Embedding]:
    """Where the bodies' mesh vertices lie in the flesh's tets, which are the same in all poses."""
    mesh = TetMesh(flesh.rest, flesh.cells)
    return {m: Embedding.embed(b.mesh.vertices, mesh) for m, b in bodies.items()}


def _starts(
    in_flesh: Array | None,
    body: SoftBody,
    bones: Mapping[str, Surface],
    moved: Mapping[str, RigidTransform],
    known: tuple[Mapping[str, RigidTransform], Array],
    image: Volume,
) -> Iterator[Array]:
    """The guess by the flesh, where it is known, then `_guesses`, made only if they are asked for."""
    if in_flesh is not None:
        yield in_flesh
    yield from _guesses(body, bones, moved, known, image)


def _guesses(
    body: SoftBody,
    bones: Mapping[str, Surface],
    moved: Mapping[str, RigidTransform],
    known: tuple[Mapping[str, RigidTransform], Array],
    image: Volume,
) -> list[Array]:
    """Initial guesses, vertices (n, 3) each, the one that looks most like the muscle first.

    They are moved with the bones, for several ways in which a bend spreads over the muscle, elastic between
    the bones, contracted along its fibres, or pulled taut. A thin end that crosses a joint may lie wholly
    beside itself in one guess, where no boundary is its own.
    """
    guesses = body.followed(bones, moved, [known], SPREADS)
    middle = guesses[len(SPREADS) // 2]
    for guess in (slack, contracted, taut) if len(body.attachments) > 1 else ():
        try:
            guesses.append(guess(body, moved, middle))
        except ConvergenceError as error:
            log.info("no guess by %s: %s", guess.__name__, error)
    level = estimate_muscle_level(image, body.surface_at(middle))
    strangeness = [np.abs(image.sample(body.surface_at(x).vertices) / level - 1) for x in guesses]
    order = np.argsort([np.mean(np.minimum(s, 1.0)) for s in strangeness], kind="stable")
    return [*_unlike(guesses[i] for i in order)]


def _unlike(guesses: Iterable[Array]) -> Iterator[Array]:
    """The guesses (n, 3) that differ from all before them."""
    chosen: list[Array] = []
    for x in guesses:
        if all(np.linalg.norm(x - other, axis=1).mean() > ALIKE for other in chosen):
            chosen.append(x)
            yield x


class _Pose:
    """The muscles of one pose while they are fitted, one after the other."""

    def __init__(
        self,
        name: str,
        bodies: Mapping[str, SoftBody],
        bones: Mapping[str, Surface],
        data: PoseData,
        image: Volume,
        markers: MarkerSettings | None,
        options: ShapeOptions | None,
    ) -> None:
        self.name, self.bodies, self.image = name, bodies, image
        self.bones, self.data, self.markers, self.options = bones, data, markers, options
        self.posed_bones = each_moved(bones, data.transforms)
        self.there = Distance(concatenate([*self.posed_bones.values()]))
        self.found: dict[str, Extraction] = {}

    def fitted(self, guesses: Mapping[str, Iterator[Array]]) -> dict[str, Extraction]:
        """Extractions of all muscles, by name.

        Each muscle is fitted from the guess for which the image shows most of its boundary. Where that is not
        nearly all, it is fitted again from the motion of the muscles around it. Muscles that touch have one
        brightness: a wrong guess looks right inside, but not at its boundary.
        """
        self.x = {m: next(starts) for m, starts in guesses.items()}
        for name, starts in guesses.items():
            for number, start in enumerate(chain([self.x[name]], starts), start=1):
                self._try(name, start, f"guess {number}")
                if self.found[name].seen >= SEEN:
                    break
        for name in sorted(self.bodies, key=lambda m: -self.found[m].seen):
            if self.found[name].seen < SEEN:
                self._try(name, self._carried_along(name), "as those around it")
        for name, found in self.found.items():
            if found.seen < DOUBTED:
                log.warning(
                    "%s in %s: the image shows only %.2f of its boundary. Part of it may lie elsewhere: "
                    "compare it with the image, and place markers where they differ",
                    name,
                    self.name,
                    found.seen,
                )
        return self.found

    def _try(self, name: str, start: Array, guess: str) -> None:
        """Fit a muscle from a guess, and keep that where more of its boundary is seen than before."""
        evidence = Evidence(
            self.image,
            others=[b.surface_at(self.x[m]) for m, b in self.bodies.items() if m != name],
            bones=self.there,
            points=self.data.points.get(name),
            landmarks=self.data.landmarks.get(name),
        )
        new = extract_pose(
            self.bodies[name],
            self.bones,
            self.data.transforms,
            evidence,
            start=start,
            markers=self.markers,
            options=self.options,
        )
        log.info("%s in %s: %s; the image shows %.2f of its boundary", name, self.name, guess, new.seen)
        if name not in self.found or new.seen > self.found[name].seen:
            self.found[name], self.x[name] = new, new.vertices

    def _carried_along(self, name: str) -> Array:
        """Mesh vertices (n, 3) of a muscle that moves as bones and well seen muscles around it."""
        around = [m for m in self.bodies if m != name and self.found[m].seen >= TRUSTED]
        rest = [*self.bones.values(), *(self.bodies[m].surface for m in around)]
        posed = [*self.posed_bones.values(), *(self.found[m].surface for m in around)]
        return carried_along(
            self.bodies[name].mesh.vertices, concatenate(rest).vertices, concatenate(posed).vertices
        )


def _apart(
    a: Mapping[str, RigidTransform], b: Mapping[str, RigidTransform], bodies: Mapping[str, SoftBody]
) -> float:
    """How differently two poses turn the bones of the muscles against one another, in rad."""
    pairs = {
        (list(body.attachments)[0], other) for body in bodies.values() for other in list(body.attachments)[1:]
    }
    return sum((a[p].inverse() @ a[q]).angle_to(b[p].inverse() @ b[q]) for p, q in pairs)


def _extract(
    body: SoftBody,
    transforms: Mapping[str, RigidTransform],
    start: Array,
    find: FindMarkers,
    options: ShapeOptions | None,
    landmarks: Mapping[str, Array] | None,
    loose: Sequence[sparse.csr_matrix] = (),
) -> Extraction:
    fit = fit_shape(
        EmbeddedSurface(body.mesh, body.surface, body.matrix),
        KnownPoints(body.attached(transforms), loose, body.landmarked(landmarks or {})),
        find,
        start=start,
        options=options,
    )
    surface = body.surface_at(fit.vertices)
    shown = find(surface).vertices
    seen = 1.0 if shown is None else len(shown) / max(int(body.visible.sum()), 1)
    return Extraction(surface, fit.vertices, fit, seen)


def image_markers(
    volume: Volume,
    body: SoftBody,
    settings: MarkerSettings | None = None,
    others: Sequence[Surface] = (),
    bones: Distance | None = None,
) -> FindMarkers:
    """Boundary markers found in an image along the normals of the present surface.

    There are markers only where the boundary is visible. Where muscles touch, the image shows no edge between
    them, and the edge along a normal is the neighbour's far side, or a gap beside both. A marker is dropped
    if

    - no edge was found for its vertex in neutral;
    - it is nearer to a neighbour's boundary of the same orientation than to this muscle's;
    - it is far from its vertex, and that touches a neighbour;
    - it is inside a bone: dark cortex and bright marrow have an edge of their own, under every muscle that
      lies on a bone.
    """
    trees = [Distance(other) for other in others]

    def find(surface: Surface) -> Markers:
        found = boundary_markers(volume, surface, settings, ~body.visible)
        places = surface.vertices[found.vertices]
        offsets = np.linalg.norm(found.points - places, axis=1)
        keep, far = np.ones(len(offsets), dtype=bool), np.flatnonzero(offsets >= NEAR)
        for tree in trees:
            near = about(found.points, tree.surface, offsets.max(initial=0.0))
            gap, _, _, normals = tree.signed(found.points[near])
            alike = np.einsum("ij,ij->i", normals, found.normals[near]) > SAME_SIDE
            keep[near] &= ~(alike & (np.abs(gap) < offsets[near]))
            touching = far[about(places[far], tree.surface, TOUCHING)]
            keep[touching] &= tree.signed(places[touching])[0] > TOUCHING
        if bones is not None:
            keep &= bones.signed(found.points)[0] > -WITHIN
        return Markers(found.points[keep], found.confidence[keep], found.vertices[keep])

    return find


def _mostly(surface: Surface, vertices: IntArray) -> BoolArray:
    """Vertices (n,) that, with their neighbours, are mostly in a set."""
    n = len(surface.vertices)
    inside = np.zeros(n)
    inside[vertices] = 1.0
    edges = surface.edges()
    counts = np.bincount(edges.ravel(), minlength=n) + 1.0
    votes = (
        inside
        + np.bincount(edges[:, 0], inside[edges[:, 1]], n)
        + np.bincount(edges[:, 1], inside[edges[:, 0]], n)
    )
    return votes > 0.5 * counts
