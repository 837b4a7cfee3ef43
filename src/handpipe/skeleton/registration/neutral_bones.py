"""Which neutral bones are too short or too far from their neighbours to be whole.

No other pose tells a neutral bone's size. Published lengths of the hand's segments do, up to the hand's own
scale, and so do the hand's joints: bones that meet in a joint nearly touch. Joints of other names may join
bones that do not touch, as radius and capitate; a gap there is only logged.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping

import numpy as np

from handpipe.core import Array
from handpipe.core.configuration import Joint
from handpipe.mesh.surfaces import Distance, Surface

# mm, metacarpal to distal phalanx of a median male hand: Buryanov and Kotiuk 2010, "Proportions of hand
# segments". The thumb has no middle phalanx.
RAYS = ((49, 32, 22), (66, 40, 22, 16), (69, 44, 24, 17), (65, 41, 22, 16), (57, 31, 18, 14))
KINDS = ("metacarpal", "proximal", "middle", "distal")
LENGTHS = {
    f"{kind}{finger}": float(length)
    for finger, ray in enumerate(RAYS, 1)
    for kind, length in zip(
        KINDS if len(ray) == 4 else ("metacarpal", "proximal", "distal"), ray, strict=True
    )
}
log = logging.getLogger(__name__)

SHELLS = 1.4  # mm of cortex at both ends together, which the marrow lacks
FEWEST = 3  # bones of known length that tell the hand's scale
SHORT, LONG = 0.82, 1.25  # of the length that the hand's other bones suggest
CLEARLY = 0.85  # times the other bone's relative length: shorter by more than hands differ
GAP = 5.0  # mm between the marrows of bones that meet: two thin shells and cartilage are 2 to 4 mm


def neutral_doubts(
    marrows: Mapping[str, Surface], joints: Mapping[str, Joint], cut: Collection[str] = ()
) -> dict[str, str]:
    """Bones that look cut short or too long in the neutral pose.

    Parameters
    ----------
    marrows : mapping of str to Surface
        Closed marrow surfaces of the neutral bones in mm. Only lengths of bones with the names of `LENGTHS`
        are judged.
    joints : mapping of str to Joint
        Joints of the dataset. If a joint gapes, the bone that is too short for the hand is doubted, or both.
        Of a joint without a bone of `LENGTHS` the log names the gap, and no bone is doubted.
    cut : collection of str
        Bones that the volume's border cuts: their lengths say nothing.

    Returns
    -------
    dict of str to str
        Reasons by bone, with what to draw.
    """
    sizes = relative_lengths({bone: marrow for bone, marrow in marrows.items() if bone not in cut})
    reasons: dict[str, list[str]] = {}
    for bone, size in sizes.items():
        if not SHORT < size < LONG:
            remedy = "along its whole marrow" if size < 1 else "of the background where it is too long"
            text = (
                f"its length is {size:.2f} times what the hand's other bones suggest: draw strokes {remedy}"
            )
            reasons.setdefault(bone, []).append(text)
    for name, joint in joints.items():
        if not joint.angles or joint.parent not in marrows or joint.child not in marrows:
            continue  # bones that move as one need not touch
        gap, middle = _gap(marrows[joint.parent], marrows[joint.child])
        if gap > GAP:
            x, y, z = middle
            where = f"gapes by {gap:.1f} mm about ({x:.1f}, {y:.1f}, {z:.1f}) mm"
            remedy = f"draw a stroke in the marrow of {joint.parent} or {joint.child} that is missing there"
            if not {joint.parent, joint.child} & {*LENGTHS}:
                log.warning("joint %s %s: if its bones meet there, %s", name, where, remedy)
                continue
            text = f"its joint {name} {where}: {remedy}"
            for bone in _at_fault(joint, sizes):
                reasons.setdefault(bone, []).append(text)
    return {bone: "; ".join(texts) for bone, texts in reasons.items()}


def relative_lengths(marrows: Mapping[str, Surface]) -> dict[str, float]:
    """Length of each bone over its published one, over the median of that ratio; empty for a few bones."""
    ratios = {
        bone: (length_of(surface) + SHELLS) / LENGTHS[bone]
        for bone, surface in marrows.items()
        if bone in LENGTHS
    }
    if len(ratios) < FEWEST:
        return {}
    scale = float(np.median(list(ratios.values())))
    return {bone: ratio / scale for bone, ratio in ratios.items()}


def length_of(surface: Surface) -> float:
    """A surface's extent in mm along its longest principal axis."""
    centred = surface.vertices - surface.vertices.mean(axis=0)
    return float(np.ptp(centred @ np.linalg.eigh(centred.T @ centred)[1][:, -1]))


def _gap(parent: Surface, child: Surface) -> tuple[float, Array]:
    """Least distance in mm between two surfaces, and the point half-way."""
    distances, _, closest = Distance(parent).closest(child.vertices)
    nearest = int(np.argmin(distances))
    return float(distances[nearest]), 0.5 * (child.vertices[nearest] + closest[nearest])


def _at_fault(joint: Joint, sizes: Mapping[str, float]) -> list[str]:
    """The bone of a joint that is clearly shorter for the hand than the other; both where none is."""
    pair = joint.parent, joint.child
    if all(bone in sizes for bone in pair):
        short, other = sorted(pair, key=lambda bone: sizes[bone])
        if sizes[short] < CLEARLY * sizes[other]:
            return [short]
    return list(pair)
