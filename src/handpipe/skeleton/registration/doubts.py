"""Which of a pose's registered bones are not to be trusted, by what its other bones say.

A bone that was segmented from a neighbour's seeds can fit well: it lies elsewhere. A phalanx that was turned
about its long axis lies where it should: it is twisted in its joints. The other joints of an odd joint's two
bones show which of the two is at fault.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from handpipe.core.configuration import Joint
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.bones.registration_result import Registration, loosest_turn
from handpipe.skeleton.joints.axes import Axes, orthogonal_hints
from handpipe.skeleton.joints.hinted_axes import beyond_hints

LOOSE = 8.0  # deg of uncertainty beyond which a turn is undetermined
RESIDUAL = 3.0  # times the median residual of the pose's bones
LEAST_RESIDUAL = 0.12  # mm; below, no residual is odd
GAP = 4.0  # mm by which a joint may open against neutral
TWIST = 30.0  # deg that axes within 30 deg of the hinted ones do not explain
STIFF = 8.0  # deg between bones that move as one
END = 0.02  # quantile of the distances to the other bone: the end that rolls on it


def doubted(
    found: Mapping[str, Registration], neutral: Mapping[str, Surface], joints: Mapping[str, Joint]
) -> dict[str, Registration]:
    """The registrations of one pose, with the reasons of those in doubt.

    Parameters
    ----------
    found : mapping of str to Registration
        Registrations by bone.
    neutral : mapping of str to Surface
        Neutral marrow surfaces that were registered, mm.
    joints : mapping of str to Joint
        Joints of the dataset.

    Returns
    -------
    dict of str to Registration
        The same registrations; `doubt` is empty for those that are trusted.
    """
    reasons = loose_turns(found, neutral) | odd_residuals(found)
    reasons |= {b: r.doubt for b, r in found.items() if r.doubt}
    trusted = {b: r for b, r in found.items() if b not in reasons}
    reasons |= odd_joints(trusted, neutral, joints)
    return {b: replace(r, doubt=reasons.get(b, "")) for b, r in found.items()}


def loose_turns(found: Mapping[str, Registration], neutral: Mapping[str, Surface]) -> dict[str, str]:
    """Bones whose turn neither surfaces nor images determine, with the reason."""
    return {
        b: f"its image hardly tells {loosest_turn(r, neutral[b])}"
        for b, r in found.items()
        if r.rotation_deviation > LOOSE
    }


def odd_residuals(found: Mapping[str, Registration]) -> dict[str, str]:
    """Bones whose residual is far larger than that of the pose's other bones, with the reason."""
    usual = float(np.median([r.rms for r in found.values()]))
    limit = max(RESIDUAL * usual, LEAST_RESIDUAL)
    return {
        b: f"its residual of {r.rms:.2f} mm is far above the {usual:.2f} mm of others"
        for b, r in found.items()
        if r.rms > limit
    }


def odd_joints(
    found: Mapping[str, Registration], neutral: Mapping[str, Surface], joints: Mapping[str, Joint]
) -> dict[str, str]:
    """Bones that explain why joints gape or are twisted, with the reason."""
    there = {n: (j.parent, j.child) for n, j in joints.items() if j.parent in found and j.child in found}
    reasons = {}
    for name, (parent, child) in there.items():
        gap = opening(found[parent], found[child], neutral[parent], neutral[child])
        twist = off_axes(found[parent], found[child], joints[name])
        if gap > GAP:
            reasons[name] = f"its joint {name} is open by {gap:.1f} mm more than in neutral"
        elif twist > (TWIST if joints[name].angles else STIFF):
            reasons[name] = f"its joint {name} is twisted by {twist:.0f} deg off its axes"
    blamed = blame(reasons, there)
    return {bone: reasons[name] for bone, name in blamed.items()}


def opening(parent: Registration, child: Registration, of_parent: Surface, of_child: Surface) -> float:
    """How much farther in mm from the parent the child's end at the joint is than in neutral.

    A child rolls and glides on its parent with that end, so that it stays near in every pose.
    """
    distance = Distance(of_parent)
    gaps, _, _ = distance.closest(of_child.vertices)
    end = of_child.vertices[gaps <= np.quantile(gaps, END)].mean(axis=0)[None]
    moved = (parent.transform.inverse() @ child.transform)(end)
    return float(distance.closest(moved)[0][0] - distance.closest(end)[0][0])


def off_axes(parent: Registration, child: Registration, joint: Joint) -> float:
    """Angle in deg of the joint's motion that turns about axes near the hinted ones do not explain."""
    if not joint.angles:
        return float(np.degrees(parent.transform.angle_to(child.transform)))
    relative = (parent.transform.inverse() @ child.transform).rotation
    axes = Axes(orthogonal_hints(np.array(joint.axis_hints, float)), tuple(range(len(joint.angles))))
    return float(np.degrees(beyond_hints(axes, relative)))


def blame(odd: Iterable[str], joints: Mapping[str, tuple[str, str]]) -> dict[str, str]:
    """The bones at fault for odd joints, as few as explain all of them.

    The bone of which the largest share of joints is odd comes first; of equals, the one with more odd joints,
    and a child before its parent.

    Parameters
    ----------
    odd : iterable of str
        Names of the odd joints.
    joints : mapping of str to (str, str)
        Parent and child of all joints that were judged.

    Returns
    -------
    dict of str to str
        One odd joint of each bone at fault.
    """
    left, blamed = set(odd), {}
    bones = list(dict.fromkeys(b for pair in joints.values() for b in reversed(pair)))
    of = {b: [n for n, pair in joints.items() if b in pair] for b in bones}
    while left:
        odd_of = {b: [n for n in of[b] if n in left] for b in bones}
        worst = max(bones, key=lambda b: (len(odd_of[b]) / len(of[b]), len(odd_of[b])))
        blamed[worst] = odd_of[worst][0]
        left -= set(odd_of[worst])
    return blamed
