"""Where every bone of a hand is in the image of a pose: the neutral bones, moved joint by joint onto it.

The root's bones first, wherever they lie; then outwards along the joints, with several guesses kept for each
branch, until the branches are chosen so that they do not overlap. Nothing of any other pose is used.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, product

import numpy as np

from handpipe.core import RigidTransform
from handpipe.core.configuration import Dataset, Segmentation
from handpipe.imaging.evidence import MarrowEvidence
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.localisation.bone_probes import MovingBones, Probes, all_bodies
from handpipe.skeleton.localisation.edge_agreement import agreement, onto_edges
from handpipe.skeleton.localisation.joint_search import Link, all_links
from handpipe.skeleton.localisation.motion_search import (
    FEW,
    Motions,
    best_distinct,
    coarse_contrast,
    fine_contrast,
    improved,
)
from handpipe.skeleton.localisation.root_search import root_starts

LOG = logging.getLogger(__name__)

CANDIDATES = 24  # trials that are improved
REFINED = 5  # of them brought onto the edges
WELL, THOROUGH = 0.75, 4  # share of edges below which a search follows so many times more trials
GUESSES = 4  # kept for a branch
BEHIND = 0.6  # of a bone's edges: guesses that far behind the best are dropped
NO_DOUBT = 0.9  # of the root's edges: no other start is tried
SAME = 1.0  # mm (rms) between two motions that count as one
OVERLAP_DEPTH = 1.0  # mm of marrow inside another whole bone
TURN = 0.004  # 1/deg: what a guess loses by each degree that its joint's axes do not explain
CROWDED = 4.0  # what a bone wholly inside others loses, in bones that agree


@dataclass(frozen=True)
class HandModel:
    """The neutral hand that is searched for in images.

    Parameters
    ----------
    bodies : list of MovingBones
        Groups of bones that move as one, the root's first.
    links : list of Link
        Joints between the bodies, parents first.
    probes : dict of str to Probes
        Points of each bone at which an image is sampled.
    marrow : dict of str to Surface
        Neutral marrow surface of each bone in mm.
    distances : dict of str to Distance
        Distances to each whole neutral bone.
    edges : float
        Share of a bone's edges that leaves no doubt about its place.
    """

    bodies: list[MovingBones]
    links: list[Link]
    probes: dict[str, Probes]
    marrow: dict[str, Surface]
    distances: dict[str, Distance]
    edges: float = Segmentation().edges

    @staticmethod
    def build(dataset: Dataset, marrow: Mapping[str, Surface], whole: Mapping[str, Surface]) -> HandModel:
        """From the neutral surfaces of all bones of a dataset."""
        probes = {bone: Probes.sample(marrow[bone]) for bone in dataset.bones}
        bodies = all_bodies(dataset, probes)
        distances = {bone: Distance(whole[bone]) for bone in dataset.bones}
        edges = (dataset.segmentation or Segmentation()).edges
        return HandModel(bodies, all_links(dataset, whole, bodies), probes, dict(marrow), distances, edges)

    def overlap(self, bone: str, at: RigidTransform, other: str, there: RigidTransform) -> float:
        """Share of a bone's marrow surface that lies deep inside another bone."""
        points = (there.inverse() @ at)(self.probes[bone].points[:80])
        box = self.distances[other].surface.vertices
        inside = ((points > box.min(axis=0)) & (points < box.max(axis=0))).all(axis=1)
        if not inside.any():
            return 0.0
        return float((self.distances[other].signed(points[inside])[0] < -OVERLAP_DEPTH).sum() / len(points))

    def bodies_overlap(self, a: int, at: RigidTransform, b: int, there: RigidTransform) -> float:
        """The greatest overlap of any bone of one body with one of another, either way."""
        reach = self.bodies[a].size + self.bodies[b].size
        if np.linalg.norm(at(self.bodies[a].middle) - there(self.bodies[b].middle)) > reach:
            return 0.0
        pairs = product(self.bodies[a].bones, self.bodies[b].bones)
        return max(max(self.overlap(p, at, q, there), self.overlap(q, there, p, at)) for p, q in pairs)


@dataclass(frozen=True)
class BodyMotions:
    """Motions of some bodies, by number, and their score."""

    motions: dict[int, RigidTransform]
    score: float = 0.0

    def with_body(self, number: int, motion: RigidTransform, score: float) -> BodyMotions:
        """The same guess with the motion of body `number`, and `score` added to its own."""
        return BodyMotions({**self.motions, number: motion}, self.score + score)


@dataclass
class PoseSearch:
    """One pose's search: the neutral model, the image's evidence, and reproducible random trials."""

    model: HandModel
    evidence: MarrowEvidence
    random: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    def root(self) -> RigidTransform:
        """The motion of the root's body that agrees best; starts are tried until one leaves no doubt."""
        body = self.model.bodies[0]
        found: list[tuple[RigidTransform, float]] = []
        for starts in root_starts(self.evidence, {b: self.model.marrow[b] for b in body.bones}):
            found += self._best(body, starts, prior=False)
            LOG.info("root: edges agree by %s", np.round(sorted(share for _, share in found)[::-1], 2))
            if max(share for _, share in found) > NO_DOUBT:
                break
        return max(found, key=lambda pair: pair[1])[0]

    def branch(self, links: Sequence[Link], root: RigidTransform) -> list[BodyMotions]:
        """Guesses of all bodies beyond one joint of the root, best first."""
        guesses = [BodyMotions({0: root})]
        for link in links:
            longer = [
                guess.with_body(link.child, motion, score)
                for guess in guesses
                for motion, score in self._children(link, guess)
            ]
            best = max(guess.score for guess in longer)
            guesses = sorted((g for g in longer if g.score > best - BEHIND), key=lambda g: -g.score)[:GUESSES]
        return guesses

    def _children(self, link: Link, guess: BodyMotions) -> list[tuple[RigidTransform, float]]:
        """Motions of a joint's child, and their scores from the image, the joint and overlaps."""
        body, parent = self.model.bodies[link.child], guess.motions[link.parent]
        found = []
        for motion, agrees in self._best(body, link.trials.carried(parent), prior=True):
            crowd = max(self.model.bodies_overlap(link.child, motion, n, m) for n, m in guess.motions.items())
            departure = link.departure(parent, motion)
            doubt = 0.5 * (1 - departure.plausible) + TURN * departure.turn
            found.append((motion, agrees - doubt - CROWDED * crowd))
        return found

    def _best(self, body: MovingBones, trials: Motions, *, prior: bool) -> list[tuple[RigidTransform, float]]:
        """A few distinct motions on the image's edges, and the shares of the edges that agree, best first.

        Where none agrees well more trials are followed: a small bone shows little in the coarse images.
        """
        found = self._followed(body, trials, CANDIDATES, REFINED, prior=prior)
        if found[0][1] < WELL:
            found = self._followed(body, trials, THOROUGH * CANDIDATES, THOROUGH * REFINED, prior=prior)
        return found

    def _followed(
        self, body: MovingBones, trials: Motions, candidates: int, refined: int, *, prior: bool
    ) -> list[tuple[RigidTransform, float]]:
        """The best trials improved, and the best of these brought onto the edges."""
        scores = coarse_contrast(self.evidence, body.probes.first(FEW), trials)
        motions = trials[best_distinct(body, trials, scores, candidates, 2 * SAME)]
        motions = improved(self.evidence, body, motions, self.random)
        scores = fine_contrast(self.evidence, body.probes, motions)
        motions = motions[best_distinct(body, motions, scores, refined, SAME)]
        on_edges = [onto_edges(self.evidence.fine, body, t, prior=prior) for t in motions.transforms()]
        shares = np.array([agreement(self.evidence.fine, body.probes, t).share for t in on_edges])
        kept = best_distinct(body, Motions.stack(on_edges), shares, REFINED, SAME)
        return [(on_edges[i], float(shares[i])) for i in kept]


def locate(model: HandModel, evidence: MarrowEvidence) -> dict[str, RigidTransform]:
    """The most likely transform of every bone in the image of a pose.

    Every bone has one, however weak the evidence for it: `confidences` says how weak.

    Parameters
    ----------
    model : HandModel
        The neutral hand.
    evidence : MarrowEvidence
        Image of the pose.

    Returns
    -------
    dict of str to RigidTransform
        Transform from neutral to the pose's frame (mm) by bone.
    """
    search = PoseSearch(model, evidence)
    root = search.root()
    branches = [search.branch(links, root) for links in _branches(model.links)]
    chosen = _without_overlap(model, branches)
    motions = {0: root} | {n: m for guess in chosen for n, m in guess.motions.items()}
    return {bone: motions[i] for i, body in enumerate(model.bodies) for bone in body.bones}


def moved_surfaces(
    surfaces: Mapping[str, Surface], motions: Mapping[str, RigidTransform]
) -> dict[str, Surface]:
    """Neutral surfaces of bones moved into a pose.

    Parameters
    ----------
    surfaces : mapping of str to Surface
        Neutral surfaces in mm by bone.
    motions : mapping of str to RigidTransform
        Transforms from neutral by bone.

    Returns
    -------
    dict of str to Surface
        Surface in the pose of each bone in `motions`.
    """
    return {bone: surfaces[bone].moved(motion(surfaces[bone].vertices)) for bone, motion in motions.items()}


def _branches(links: Sequence[Link]) -> list[list[Link]]:
    """The joints grouped by the child of the root that they descend from."""
    branch_of: dict[int, list[Link]] = {}
    found = []
    for link in links:
        if link.parent == 0:
            found.append(branch := [link])
        else:
            branch = branch_of[link.parent]
            branch.append(link)
        branch_of[link.child] = branch
    return found


def _without_overlap(model: HandModel, branches: Sequence[Sequence[BodyMotions]]) -> list[BodyMotions]:
    """One guess of each branch: the combination with the highest score, overlaps deducted."""
    shared = {
        (a, i, b, j): _crowd(model, branches[a][i], branches[b][j])
        for a, b in combinations(range(len(branches)), 2)
        for i, j in product(range(len(branches[a])), range(len(branches[b])))
    }

    def worth(chosen: tuple[int, ...]) -> float:
        crowd = sum(shared[a, chosen[a], b, chosen[b]] for a, b in combinations(range(len(chosen)), 2))
        return sum(branches[a][i].score for a, i in enumerate(chosen)) - CROWDED * crowd

    best = max(product(*(range(len(b)) for b in branches)), key=worth)
    return [branches[a][i] for a, i in enumerate(best)]


def _crowd(model: HandModel, a: BodyMotions, b: BodyMotions) -> float:
    """Overlaps of the bodies of two branches, summed."""
    return sum(
        model.bodies_overlap(n, s, m, t)
        for n, s in a.motions.items()
        for m, t in b.motions.items()
        if n != 0 and m != 0
    )
