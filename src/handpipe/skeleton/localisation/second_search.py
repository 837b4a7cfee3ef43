"""A second search for marked and doubtful bones: each motion that the joint allows, fitted to the edges.

The first search follows the coarse images, in which a marrow of two or three voxels across shows less than
the fat beside it. It may leave a trial that lay within a millimetre of the bone. Nor does it return to a bone
if a bone beyond it was missed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from handpipe.core import RigidTransform
from handpipe.imaging.evidence import MarrowEvidence
from handpipe.skeleton.localisation.bone_probes import MovingBones
from handpipe.skeleton.localisation.edge_agreement import agreement, onto_edges
from handpipe.skeleton.localisation.locating import HandModel
from handpipe.skeleton.localisation.location_confidence import LocationConfidence, confidences
from handpipe.skeleton.localisation.motion_search import FEW, Motions, best_distinct, coarse_contrast

TRIALS = 300  # of a joint that are followed: all of a hinge's
APART = 0.5  # mm (rms) between two trials
GUESSES, SAME = 4, 1.0  # 1 and mm: places that are weighed; rms within which two are one


def search_again(
    hand: HandModel,
    evidence: MarrowEvidence,
    motions: Mapping[str, RigidTransform],
    sure: Mapping[str, LocationConfidence],
) -> tuple[dict[str, RigidTransform], dict[str, LocationConfidence]]:
    """Motions and confidences after a second search for marked and doubtful bones.

    Parents come before the bones that they carry. A bone keeps its place if no place with more confidence is
    found. The root is not searched for again.

    Parameters
    ----------
    hand : HandModel
        The neutral hand.
    evidence : MarrowEvidence
        Image of the pose.
    motions : mapping of str to RigidTransform
        Transforms from neutral by bone, as `locate` gives them.
    sure : mapping of str to LocationConfidence
        Confidence by bone, as `confidences` gives it.

    Returns
    -------
    motions : dict of str to RigidTransform
        Transforms from neutral (mm) by bone.
    sure : dict of str to LocationConfidence
        Confidence by bone.
    """
    motions, sure = dict(motions), dict(sure)
    for link in hand.links:
        bones, parent = hand.bodies[link.child].bones, hand.bodies[link.parent].bones[0]
        if not any(sure[bone].marked or sure[bone].near for bone in bones):
            continue
        for motion in _places(evidence, hand.bodies[link.child], link.trials.carried(motions[parent])):
            trial = motions | dict.fromkeys(bones, motion)
            judged = confidences(hand, evidence.fine, trial)
            if min(judged[b].value for b in bones) > min(sure[b].value for b in bones):
                motions, sure = trial, judged
    return motions, sure


def _places(evidence: MarrowEvidence, body: MovingBones, trials: Motions) -> list[RigidTransform]:
    """Distinct motions of a body on the image's edges, those first on which most of its edges agree."""
    few = replace(body, probes=body.probes.first(FEW))
    followed = best_distinct(body, trials, coarse_contrast(evidence, few.probes, trials), TRIALS, APART)
    found = [onto_edges(evidence.fine, few, t, prior=False) for t in trials[followed].transforms()]
    shares = np.array([agreement(evidence.fine, few.probes, t).share for t in found])
    return [found[i] for i in best_distinct(body, Motions.stack(found), shares, GUESSES, SAME)]
