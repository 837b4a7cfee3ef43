"""Which bright solid is which bone: a template hand laid into the image, and its fingers followed outwards.

Bones differ from person to person in size and proportion, and joints in their angles. So a solid is named by
what people share: which bones meet in a joint, how long and how wide they are for the hand, and where the
metacarpals and carpals lie among one another.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from scipy.optimize import linear_sum_assignment

from handpipe.core import Array, BoolArray
from handpipe.core.configuration import Dataset
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.bones.bodies import bodies
from handpipe.skeleton.localisation.bright_solids import BrightSolid, SolidShape
from handpipe.skeleton.localisation.hand_layout import Placed, Similarity, layouts
from handpipe.skeleton.localisation.joint_search import falling

log = logging.getLogger(__name__)

CORTEX = 0.8  # mm of the template's bones that is not marrow
LENGTHS, WIDTHS, VOLUMES = 0.15, 0.25, 0.45  # logarithms by which bones of people usually differ
PLUMP = 0.2  # the same of the lengths of carpals
INSIDE = 4.0  # mm, at the template's scale, from a lost bone's place to a solid that may hold it, too
GAP = 3.0  # mm by which the ends of two bones of a joint usually differ from the template's
BENT = 120.0  # deg between two bones of a joint: more is none
LOST = 14.0  # cost of a bone without a solid
PARTIAL, CHAINS = 8, 4  # chains that are followed, and kept of each finger
SHARED = 0.1  # of the smaller of two solids that overlap
PLACE = 5.0  # mm, at the template's scale, by which a carpal or metacarpal is usually off
WAYS = 12  # layouts that are followed outwards
SURE = 0.5  # below it a person has to draw
COSTS = (6.0, 16.0)  # from where to where a bone's cost takes its confidence away
FEWEST = 2 / 3  # of the bones that are sure, or none is
MARGINS = (0.5, 2.0)  # bones by which the best naming has to beat any other
RIVALS = (2.0, 8.0)  # cost by which a bone's solid has to beat any other at the same joint that is no bone
OPEN = 0.15  # share of the boundary without a shell that costs 1


@dataclass(frozen=True)
class Named:
    """A bone's solid, and the evidence for it.

    Parameters
    ----------
    solid : BrightSolid or None
        None where none was found.
    confidence : float
        In [0, 1].
    reason : str
        What speaks against it most, in words.
    """

    solid: BrightSolid | None
    confidence: float
    reason: str

    @property
    def marked(self) -> bool:
        """Whether a person has to draw its strokes."""
        return self.solid is None or self.confidence < SURE


@dataclass(frozen=True)
class JointGap:
    """A joint of the template: which ends of its bones meet, and how far apart, in mm."""

    parent: str
    child: str
    parent_end: int
    child_end: int
    gap: float


@dataclass(frozen=True)
class TemplateHand:
    """What of a template hand is compared with solids.

    Parameters
    ----------
    shapes : dict of str to SolidShape
        The marrow of each bone.
    near_root : list of str
        Bones that keep their places among one another, roughly: those of the root and next to it.
    rays : list of list of JointGap
        Joints outwards of each bone next to the root.
    """

    shapes: dict[str, SolidShape]
    near_root: list[str]
    rays: list[list[JointGap]]

    @staticmethod
    def build(dataset: Dataset, whole: Mapping[str, Surface]) -> TemplateHand:
        """From the template's whole bones and the joints between them."""
        shapes = {bone: SolidShape.inside(whole[bone], CORTEX) for bone in dataset.bones}
        root = next((group for group in bodies(dataset) if dataset.root_bone in group), (dataset.root_bone,))
        moving = [joint for joint in dataset.joints.values() if joint.angles]
        beside = [j.child for j in moving if j.parent in root and not shapes[j.parent].slim]
        near_root = [*root, *beside]
        rays = []
        for first in (bone for bone in near_root if shapes[bone].slim):
            ray, bone = [], first
            while onward := next((j for j in moving if j.parent == bone), None):
                ray.append(_joint(shapes, onward.parent, onward.child))
                bone = onward.child
            rays.append(ray)
        return TemplateHand(shapes, near_root, rays)


def _joint(shapes: Mapping[str, SolidShape], parent: str, child: str) -> JointGap:
    """The ends of two bones that are nearest to one another in the template."""
    apart = np.linalg.norm(shapes[parent].ends[:, None] - shapes[child].ends[None], axis=-1)
    i, j = np.unravel_index(int(apart.argmin()), (2, 2))
    return JointGap(parent, child, int(i), int(j), float(apart[i, j]))


@dataclass(frozen=True)
class Naming:
    """Solids of bones, with the cost of each.

    Parameters
    ----------
    solids : dict of str to int
        Number of each bone's solid; bones without one are missing.
    costs : dict of str to float
        Cost of each bone, about the square of how many usual deviations it is off.
    places : dict of str to array (4,)
        Of bones near the root that were not found, where they would be, and within how many mm.
    """

    solids: dict[str, int] = field(default_factory=dict)
    costs: dict[str, float] = field(default_factory=dict)
    places: dict[str, Array] = field(default_factory=dict)

    @property
    def cost(self) -> float:
        """Of all its bones."""
        return sum(self.costs.values())

    def joined(self, other: Naming) -> Naming:
        """Both together."""
        places = {**self.places, **other.places}
        return Naming({**self.solids, **other.solids}, {**self.costs, **other.costs}, places)


@dataclass(frozen=True)
class ImageSolids:
    """One image's solids, and which of them overlap, (n, n)."""

    hand: TemplateHand
    solids: Sequence[BrightSolid]
    overlapping: BoolArray

    def naming(self, placed: Placed) -> Naming:
        """The best names under one layout: of the bones near the root, then of the fingers."""
        named, ends = self._near_root(placed)
        rays = [[*self._chains(ray, named, ends, placed.similarity.scale)] for ray in self.hand.rays]
        best = None
        for chosen in product(*rays):
            whole = named
            for chain in chosen:
                whole = whole.joined(chain)
            if (best is None or whole.cost < best.cost) and not self._crowded(whole):
                best = whole
        lost = {joint.child: LOST for ray in self.hand.rays for joint in ray}
        return best or named.joined(Naming({}, lost))

    def rivals(self, placed: Placed, naming: Naming) -> dict[str, float]:
        """By how much the next solid at each joint costs more that is no part of a named one."""
        named, ends = self._near_root(placed)
        taken: BoolArray = np.any(self.overlapping[[*naming.solids.values()]], axis=0).reshape(-1)
        found: dict[str, float] = {}
        for ray in self.hand.rays:
            parent = ends.get(ray[0].parent) if ray else None
            for joint in ray:
                if parent is None or joint.child not in naming.solids:
                    break
                children = [*self._children(joint, parent, placed.similarity.scale)]
                own = naming.solids[joint.child]
                parent, cost = next((e, c) for k, e, c in children if k == own)
                found[joint.child] = min((c - cost for k, _, c in children if not taken[k]), default=np.inf)
        return found

    def parted(self, placed: Placed, naming: Naming) -> dict[str, str]:
        """Bones of a joint whose solids one solid holds that fits either bone: of each, the other."""
        found: dict[str, str] = {}
        for joint in (joint for ray in self.hand.rays for joint in ray if joint.child in naming.solids):
            pair = joint.parent, joint.child
            first, second = (self.overlapping[naming.solids[bone]] for bone in pair)
            shared = zip(self.solids, first & second, strict=True)
            wholes = [solid for solid, holds_both in shared if holds_both]
            scale = placed.similarity.scale
            costs = [self._size_cost(bone, solid, scale) for bone in pair for solid in wholes]
            if falling(min(costs, default=np.inf), *COSTS) >= SURE:
                found |= {joint.parent: joint.child, joint.child: joint.parent}
        return found

    def _crowded(self, naming: Naming) -> bool:
        numbers = [*naming.solids.values()]
        shared = self.overlapping[np.ix_(numbers, numbers)]
        return bool(np.triu(shared, 1).any())

    def _near_root(self, placed: Placed) -> tuple[Naming, dict[str, Array]]:
        """Bones near the root with the solids in their places, and their ends in the template's order."""
        at, bones = placed.similarity, self.hand.near_root
        cost = np.array([[self._place_cost(bone, solid, at) for solid in self.solids] for bone in bones])
        rows, columns = linear_sum_assignment(np.minimum(cost, 2 * LOST))
        named, ends = Naming(), {}
        for row, column in zip(rows, columns, strict=True):
            bone, value = bones[row], float(cost[row, column])
            if value >= 2 * LOST:
                named.costs[bone] = LOST
                named.places[bone] = np.append(at(self.hand.shapes[bone].middle), INSIDE * at.scale)
                continue
            named.solids[bone], named.costs[bone] = int(column), value
            ends[bone] = _ordered(self.solids[column].shape.ends, at(self.hand.shapes[bone].ends))
        return named, ends

    def _place_cost(self, bone: str, solid: BrightSolid, at: Similarity) -> float:
        """How unlike a solid is to a bone near the root in size and place."""
        own, shape = self.hand.shapes[bone], solid.shape
        cost = self._size_cost(bone, solid, at.scale)
        if cost > 2 * LOST:
            return cost
        places = at(own.ends)
        off = np.linalg.norm(_ordered(shape.ends, places) - places, axis=1).mean() if own.slim else 0.0
        if not own.slim:
            off = float(np.linalg.norm(shape.middle - at(own.middle)))
        return cost + float((off / (PLACE * at.scale)) ** 2)

    def _size_cost(self, bone: str, solid: BrightSolid, scale: float) -> float:
        own, shape = self.hand.shapes[bone], solid.shape
        cost = ((1 - solid.enclosed) / OPEN) ** 2
        if own.slim:
            cost += (np.log(shape.length / (scale * own.length)) / LENGTHS) ** 2
            return float(cost + (np.log(shape.width / (scale * own.width)) / WIDTHS) ** 2)
        cost += (np.log(shape.length / (scale * own.length)) / PLUMP) ** 2
        return float(cost + (np.log(shape.volume / (scale**3 * own.volume)) / VOLUMES) ** 2)

    def _chains(
        self, ray: Sequence[JointGap], named: Naming, ends: Mapping[str, Array], scale: float
    ) -> Iterator[Naming]:
        """The best chains of solids outwards from a bone; where one is missing, all beyond it are."""
        if not ray or ray[0].parent not in ends:
            yield Naming({}, {joint.child: LOST for joint in ray})
            return
        chains = [(Naming(), ends[ray[0].parent])]
        for number, joint in enumerate(ray):
            longer = [(n, e) for n, e in chains if len(n.costs) > number]
            for naming, parent in (c for c in chains if len(c[0].costs) == number):
                for k, found, cost in self._children(joint, parent, scale):
                    if k not in {*naming.solids.values(), *named.solids.values()}:
                        longer.append((naming.joined(Naming({joint.child: k}, {joint.child: cost})), found))
                rest = {j.child: LOST for j in ray[number:]}
                longer.append((naming.joined(Naming({}, rest)), parent))
            chains = sorted(longer, key=lambda c: c[0].cost + LOST * (len(ray) - len(c[0].costs)))[:PARTIAL]
        yield from (naming for naming, _ in chains[:CHAINS])

    def _children(self, joint: JointGap, parent: Array, scale: float) -> Iterator[tuple[int, Array, float]]:
        """Solids that may be a joint's child: number, ends in the template's order, cost."""
        start, outwards = parent[joint.parent_end], parent[joint.parent_end] - parent[1 - joint.parent_end]
        for k, solid in enumerate(self.solids):
            both = solid.shape.ends
            near = np.linalg.norm(both - start, axis=1)
            if near.min() > joint.gap * scale + 3 * GAP:
                continue
            own = both if int(near.argmin()) == joint.child_end else both[::-1]
            along = own[1 - joint.child_end] - own[joint.child_end]
            cosine = along @ outwards / max(np.linalg.norm(along) * np.linalg.norm(outwards), 1e-9)
            cost = self._size_cost(joint.child, solid, scale) + ((near.min() - joint.gap * scale) / GAP) ** 2
            if cosine > np.cos(np.radians(BENT)) and cost < LOST:
                yield k, own, float(cost)


def _ordered(ends: Array, like: Array) -> Array:
    """Ends (2, 3) in the order in which they are nearer to others."""
    straight = np.linalg.norm(ends - like, axis=1).max()
    return ends if straight <= np.linalg.norm(ends[::-1] - like, axis=1).max() else ends[::-1]


def name_solids(hand: TemplateHand, solids: Sequence[BrightSolid]) -> dict[str, Named]:
    """The solid of each bone, and how sure it is.

    Parameters
    ----------
    hand : TemplateHand
        A template hand of any size, of the same side.
    solids : sequence of BrightSolid
        Bright solids of the image.

    Returns
    -------
    dict of str to Named
        By bone; a bone that was not found has no solid.
    """
    near = {bone: hand.shapes[bone] for bone in hand.near_root}
    ways = layouts(near, [bone for bone in near if near[bone].slim], solids)[:WAYS]
    search = ImageSolids(hand, solids, _overlapping(solids))
    tried = sorted(((search.naming(placed), placed) for placed in ways), key=lambda n: n[0].cost)
    if not tried:
        return {bone: Named(None, 0.0, "no metacarpals were found") for bone in hand.shapes}
    namings, (best, placed) = [naming for naming, _ in tried], tried[0]
    doubts = NamingDoubts(search.rivals(placed, best), search.parted(placed, best))
    carried = {j.child: j.parent for ray in hand.rays for j in ray}
    found: dict[str, Named] = {}
    for bone in (*hand.near_root, *(j.child for ray in hand.rays for j in ray)):
        before = found[carried[bone]].confidence if bone in carried else 1.0
        margin = _margin(bone, namings, search.overlapping)
        before *= falling(-margin, -MARGINS[1], -MARGINS[0])
        log.info("%s: costs %.1f, any other solid %.1f bones more", bone, best.costs[bone], margin)
        found[bone] = _named(bone, best, solids, before, doubts)
    unreached = {bone for bone in hand.shapes if bone not in found}
    found |= {bone: Named(None, 0.0, "no joint leads to it") for bone in unreached}
    if sum(not bone.marked for bone in found.values()) < FEWEST * len(found):
        few = "too few bones were found to be sure of any"
        return {bone: replace(one, confidence=0.0, reason=few) for bone, one in found.items()}
    return found


@dataclass(frozen=True)
class NamingDoubts:
    """What else speaks against the best naming: rivals of bones, and bones that may be parts of one."""

    rivals: dict[str, float]
    parted: dict[str, str]


def _named(
    bone: str, naming: Naming, solids: Sequence[BrightSolid], before: float, doubts: NamingDoubts
) -> Named:
    if bone not in naming.solids:
        return Named(None, 0.0, "no solid of its size is in its place")
    solid = solids[naming.solids[bone]]
    for other, place in naming.places.items():
        if np.linalg.norm(solid.places - place[:3], axis=1).min() < place[3]:
            return Named(solid, 0.0, f"{other} was not found and may be a part of it")
    if bone in doubts.parted:
        return Named(solid, 0.0, f"{doubts.parted[bone]} and it may be parts of one bone")
    rival = falling(-doubts.rivals.get(bone, np.inf), -RIVALS[1], -RIVALS[0])
    evidence = {
        "its size or place is unusual": falling(naming.costs[bone], *COSTS),
        "another solid fits its joint as well": rival,
        "the bones before it may be named wrongly": before,
    }
    return Named(solid, float(np.prod([*evidence.values()])), min(evidence, key=lambda why: evidence[why]))


def _margin(bone: str, namings: Sequence[Naming], overlapping: BoolArray) -> float:
    """By how many lost bones all namings cost more that give a bone a solid in another place."""
    best = namings[0]
    if bone not in best.solids:
        return 0.0
    others = (n for n in namings[1:] if bone in n.solids)
    rivals = [n.cost for n in others if not overlapping[n.solids[bone], best.solids[bone]]]
    return (min(rivals) - best.cost) / LOST if rivals else np.inf


def _overlapping(solids: Sequence[BrightSolid]) -> BoolArray:
    """Which solids share voxels (n, n), themselves included."""
    voxels = [set(map(tuple, s.voxels.tolist())) for s in solids]
    boxes = np.array([[s.voxels.min(axis=0), s.voxels.max(axis=0)] for s in solids]).reshape(-1, 2, 3)
    found = np.eye(len(solids), dtype=bool)
    for i in range(len(solids)):
        for j in range(i):
            if (boxes[i, 0] <= boxes[j, 1]).all() and (boxes[j, 0] <= boxes[i, 1]).all():
                shared = len(voxels[i] & voxels[j])
                found[i, j] = found[j, i] = shared > SHARED * min(len(voxels[i]), len(voxels[j]))
    return found
