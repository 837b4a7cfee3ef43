"""Hands of known proportions from their photographs: lengths of bones, and seconds from points to a page."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.anatomy.person import Photograph, SubjectTemplate, person_of_photograph
from handpipe.anatomy.person.family import lengths_of, resized
from handpipe.anatomy.shipped import ShippedHand
from handpipe.cli.person.making import Asked, make
from handpipe.cli.person.played_hand import PlayedHand
from handpipe.core import Array, InputError, Metrics

HANDS, PIXELS = 8, 8.0  # number of hands of each case; pixels a mm
SIZES, PROPORTIONS = (0.8, 1.1), 0.04  # range of sizes over the template's; deviation of a bone's length
POSE = 4.0  # deg, deviation of each angle from those of the flat hand
CAMERA = 400.0  # mm from the hand, where the view is not from afar


class Case(NamedTuple):
    """How a photograph is taken: noise of clicks in mm, tilt of the camera in deg, whether it is near."""

    noise: float = 0.0
    tilt: float = 0.0
    near: bool = False


CASES = {
    "exact": Case(),
    "clicks": Case(noise=1.0),
    "tilt": Case(noise=1.0, tilt=10.0),
    "near": Case(noise=1.0, near=True),
}


def measure() -> Metrics:
    """Shares by which lengths are wrong, by case and kind of bone; hands that are refused; seconds."""
    shipped = ShippedHand.load()
    flat = PlayedHand.of(shipped, shipped.template).flat
    found: Metrics = {}
    for name, case in CASES.items():
        rng, refused, errors = np.random.default_rng(0), 0, []
        for _ in range(HANDS):
            truth = _person(shipped.template, rng)
            shot = _photograph(shipped, truth, flat, case, rng)
            try:
                person, _ = person_of_photograph(shipped.template, shot, flat)
            except InputError:
                refused += 1
                continue
            errors.append(_errors(lengths_of(person), lengths_of(truth)))
        found[f"photograph_{name}_refused"] = (float(refused), "hands")
        for kind in errors[0]:
            values = np.concatenate([e[kind] for e in errors])
            found[f"photograph_{name}_{kind}_mean"] = (float(np.abs(values).mean()), "1")
            found[f"photograph_{name}_{kind}_max"] = (float(np.abs(values).max()), "1")
    return found | _seconds(shot)


def _person(template: SubjectTemplate, rng: np.random.Generator) -> SubjectTemplate:
    """A hand of other size and proportions."""
    size = rng.uniform(*SIZES)
    factors = {bone: size * (1 + PROPORTIONS * rng.standard_normal()) for bone in lengths_of(template)}
    return resized(template, {bone: factors[bone] * length for bone, length in lengths_of(template).items()})


def _photograph(
    shipped: ShippedHand, truth: SubjectTemplate, flat: dict[str, float], case: Case, rng: np.random.Generator
) -> Photograph:
    """Clicks on a hand that lies almost flat, beside a ruler at the height of its points."""
    hand = PlayedHand.of(shipped, truth)
    limits = hand.rig.limits
    angles = {
        n: float(np.clip(a + np.radians(POSE) * rng.standard_normal(), *limits[n])) for n, a in flat.items()
    }
    turned = hand.rig.bone_transforms(angles)
    owner = {j.name: j.parent for j in truth.joints} | {f"tip{ray}": f"distal{ray}" for ray in range(1, 6)}
    points = np.array([turned[owner[name]](point) for name, point in truth.feature_points.items()])
    middle = points.mean(axis=0)
    ruler = middle + np.array([[-80.0, -50.0, 0.0], [-80.0, 50.0, 0.0]])
    seen = _seen(np.vstack([points, ruler]) - middle, case)
    seen[: len(points)] += PIXELS * case.noise * rng.standard_normal((len(points), 2))
    pairs = [(float(x), float(y)) for x, y in seen]
    points_by_name = dict(zip(truth.feature_points, pairs, strict=False))
    return Photograph.model_validate({"points": points_by_name, "ruler": pairs[-2:], "distance": 100.0})


def _seen(points: Array, case: Case) -> Array:
    """Pixels (n, 2) of points (n, 3) in mm around the middle, from the back of the hand."""
    moved = Rotation.from_euler("y", case.tilt, degrees=True).apply(points)
    nearer = CAMERA / (CAMERA - moved[:, 2:]) if case.near else 1.0
    return np.asarray(-PIXELS * nearer * moved[:, [1, 0]] + 1000.0)


def _errors(own: dict[str, float], true: dict[str, float]) -> dict[str, Array]:
    """Lengths over the true ones, less 1, by kind of bone; fingers: all phalanges of a ray together."""
    phalanges = [bone for bone in true if not bone.startswith("metacarpal")]
    fingers = [[bone for bone in phalanges if bone[-1] == ray] for ray in "12345"]
    return {
        "phalanges": np.array([own[bone] / true[bone] - 1 for bone in phalanges]),
        "metacarpals": np.array([own[bone] / true[bone] - 1 for bone in true if bone not in phalanges]),
        "fingers": np.array([sum(own[b] for b in f) / sum(true[b] for b in f) - 1 for f in fingers]),
    }


def _seconds(shot: Photograph) -> Metrics:
    """Seconds from a file of points to the hand, and to the page that moves it."""
    with tempfile.TemporaryDirectory() as folder:
        points = Path(folder) / "points.json"
        points.write_text(shot.model_dump_json(), encoding="utf-8")
        said = make(Asked(points, Path(folder) / "hand")).said
    read = {line.split()[5]: float(line.split()[-1]) for line in said if line.startswith("seconds from")}
    return {f"photograph_{what}_seconds": (value, "s") for what, value in read.items()}
