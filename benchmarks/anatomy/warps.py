"""MyoHand carried to Z-Anatomy: how far held-out landmarks end from where they are."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from benchmarks.anatomy.landmarks import basal, finger_joint, landmarks
from handpipe.anatomy.person import SubjectTemplate
from handpipe.anatomy.person.feature_points import doubtful
from handpipe.anatomy.person.subject_template import warped
from handpipe.anatomy.person.warp import biharmonic_warp, feature_warp, refined
from handpipe.core import Metrics
from handpipe.synthetic.template_hands import hand_templates

GROUPS: dict[str, Callable[[str], bool]] = {
    "all": lambda name: True,
    "finger_joints": finger_joint,
    "outwards": lambda name: not basal(name),
    "basal": basal,
}
MISPLACED, DIRECTIONS = 20.0, 4  # mm that a point is moved, and in how many directions each


def measure(folder: Path) -> Metrics:
    """Distances of landmarks in mm by warp and group, how well points are met, what wrong ones are named."""
    source, target = hand_templates.myohand(folder), hand_templates.zanatomy(folder)
    wanted = target.feature_points
    by_joints = feature_warp(source, wanted)
    posed = warped(source, by_joints)
    persons = {
        "paper": warped(source, biharmonic_warp(source.feature_points, wanted)),
        "posed": posed,
        "bones": refined(posed, target.bones),
    }
    truth = landmarks(target)
    found: Metrics = {}
    for way, person in persons.items():
        places = landmarks(person)
        away = {name: float(np.linalg.norm(places[name] - at)) for name, at in truth.items()}
        for group, chosen in GROUPS.items():
            values = [d for name, d in away.items() if chosen(name)]
            found[f"warp_{way}_{group}_mean"] = (float(np.mean(values)), "mm")
            found[f"warp_{way}_{group}_max"] = (max(values), "mm")
    found["warp_landmarks"] = (float(len(truth)), "1")
    reproduced = [np.linalg.norm(by_joints(p[None])[0] - wanted[n]) for n, p in source.feature_points.items()]
    found["warp_points_max"] = (float(max(reproduced)), "mm")
    found["misplaced_named"] = (_named(source, target), "1")
    return found


def _named(source: SubjectTemplate, target: SubjectTemplate) -> float:
    """Share of cases in which a point that is 20 mm off is named."""
    points, rng = target.feature_points, np.random.default_rng(0)

    def cases() -> Iterable[bool]:
        for name, place in points.items():
            for direction in rng.standard_normal((DIRECTIONS, 3)):
                away = MISPLACED * direction / np.linalg.norm(direction)
                yield name in doubtful(source.feature_points, points | {name: place + away})

    return float(np.mean(list(cases())))
