"""Scans in a frame of their own against the true skin, and wrong scans: are they refused?

The rig and the volumes are those of the built phantom finger. Scans are made anew by the closed-form maps of
the phantom, which are not the model of the alignment: other joint angles, another volume, another place. A
whole hand of round cones is the second body.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

from handpipe.core import Array, Metrics, RigidTransform
from handpipe.imaging.skin import skin_of_volume
from handpipe.imaging.volumes import Volume, read_volume
from handpipe.mesh.generation import Grid, isosurface, remesh
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.rig import Rig
from handpipe.skeleton.scan_alignment import Alignment, ImageSkin, align_scan, limits_used
from handpipe.skeleton.scan_alignment.image_skin import SkinHinge, uncut
from handpipe.synthetic.geometry.kinematics import Posture
from handpipe.synthetic.phantom import hand_skin, phantom_finger, phantom_hand
from handpipe.synthetic.phantom.hand_tissue import cone_rows, field_of_cones, skin
from handpipe.synthetic.phantom.phantom_hand_bones import WITH_ROOT

log = logging.getLogger("benchmarks.scans.alignment")

SUBJECT = "phantom-finger"
SEED = 1  # of the phantom finger's poses
POSES = ("neutral", "bow", "fist", "spread", "curl", "half")
TIMES = 2  # displacements of each pose
SHIFT, TURN, JOINT, SWELLING = 20.0, 15.0, 3.0, 0.01  # mm, deg, deg, share of the volume
HAND_POSES = ("relaxed", "spread")
HAND_VOXEL, HAND_NOISE, TRIANGLES = 0.8, 0.03, 1.8  # mm, share of the tissue's intensity, mm


@dataclass(frozen=True)
class Case:
    """A scan, and the true skin in the frame of the image; None where the scan is a wrong one."""

    name: str
    scan: Surface
    true: Surface | None


@dataclass(frozen=True)
class Outcome:
    """What came of a case: mean and largest distance (mm) of the aligned scan from the true skin."""

    name: str
    found: Alignment
    seconds: float
    mean: float = 0.0
    largest: float = 0.0

    @property
    def used(self) -> float:
        """The largest share of a limit that the alignment uses; above 1 the scan is refused."""
        return max(limits_used(self.found).values())


def measure(results: Path) -> Metrics:
    """Figures of the alignment, with the rig and the volumes of the built phantom finger."""
    subject = results / SUBJECT
    volumes = {pose: subject / "data" / "volumes" / f"{pose}.nii.gz" for pose in POSES}
    return figures(subject / "rig.h5", volumes)


def figures(rig: Path, volumes: Mapping[str, Path]) -> Metrics:
    """The figures of the alignment, by name.

    rig: of the built phantom finger; volumes: of its poses, by name.
    """
    loaded = Rig.load(rig)
    right, wrong = [], []
    for pose in POSES:
        target = _image_skin(read_volume(volumes[pose]), loaded, pose)
        right += [run(case, target) for case in displaced_fingers(pose)]
        if pose in POSES[:2]:
            wrong += [run(case, target) for case in wrong_fingers(pose)]
    hands = []
    for pose in HAND_POSES:
        posture = phantom_hand.posture(pose, SEED)
        target = hand_target(posture)
        hands += [run(case, target) for case in displaced_hands(pose, posture)]
        if pose == HAND_POSES[0]:
            wrong += [run(case, target) for case in wrong_hands(pose, posture)]
    return {
        **_errors("alignment", right),
        **_errors("alignment_hand", hands),
        **_verdicts(right + hands, wrong),
    }


def _image_skin(volume: Volume, rig: Rig, pose: str) -> ImageSkin:
    return ImageSkin.build(skin_of_volume(volume), rig, pose)


def run(case: Case, target: ImageSkin) -> Outcome:
    """Align the scan of a case and measure its vertices' distances from the true skin."""
    start = time.perf_counter()
    found = align_scan(case.scan, target)
    outcome = Outcome(case.name, found, time.perf_counter() - start)
    if case.true is not None:
        apart = Distance(case.true).closest(found.surface.vertices)[0]
        outcome = replace(outcome, mean=float(apart.mean()), largest=float(apart.max()))
    shares = ", ".join(f"{name} {share:.2f}" for name, share in limits_used(found).items())
    log.info("%s: %.3f mm, at most %.2f, %.1f s; %s", case.name, outcome.mean, outcome.largest,
             outcome.seconds, shares)  # fmt: skip
    return outcome


def _errors(name: str, outcomes: Sequence[Outcome]) -> Metrics:
    means = [outcome.mean for outcome in outcomes]
    return {
        f"{name}_error_mean": (float(np.mean(means)), "mm"),
        f"{name}_error_max": (float(float(np.max(means))), "mm"),
        f"{name}_vertex_error_max": (float(max(outcome.largest for outcome in outcomes)), "mm"),
        f"{name}_cases": (float(len(outcomes)), "1"),
        f"{name}_seconds": (float(float(np.mean([outcome.seconds for outcome in outcomes]))), "s"),
    }


def _verdicts(right: Sequence[Outcome], wrong: Sequence[Outcome]) -> Metrics:
    """How many scans are refused, and how near to the limits the nearest ones are."""
    return {
        "alignment_refused_wrong": (float(sum(outcome.used > 1 for outcome in wrong)), "1"),
        "alignment_wrong": (float(len(wrong)), "1"),
        "alignment_refused_right": (float(sum(outcome.used > 1 for outcome in right)), "1"),
        "alignment_limits_used_right_max": (float(max(outcome.used for outcome in right)), "1"),
        "alignment_limits_used_wrong_min": (float(min(outcome.used for outcome in wrong)), "1"),
    }


# Displacements of any body.
def displaced(scan: Surface, rng: np.random.Generator) -> Surface:
    """The scan with another volume, moved and turned by up to the sizes above."""
    swelling = rng.uniform(-SWELLING, SWELLING) * abs(scan.volume()) / scan.area()
    scan = scan.moved(scan.vertices + swelling * scan.vertex_normals())
    axis, shift = (v / np.linalg.norm(v) for v in rng.standard_normal((2, 3)))
    turn = Rotation.from_rotvec(np.radians(TURN * rng.uniform(0.5, 1.0)) * axis).as_matrix()
    turned = RigidTransform.about(scan.vertices.mean(axis=0), turn)(scan.vertices)
    return scan.moved(turned + SHIFT * rng.uniform(0.5, 1.0) * shift)


def bent(posture: Posture, degrees: Mapping[str, float]) -> Posture:
    """The posture with some angles changed by degrees."""
    angles = {name: angle + np.radians(degrees.get(name, 0.0)) for name, angle in posture.angles.items()}
    return replace(posture, angles=angles)


def settled(posture: Posture, rng: np.random.Generator) -> Posture:
    """The posture with every angle changed by up to the size above."""
    return bent(posture, {name: rng.uniform(-JOINT, JOINT) for name in posture.angles})


# The phantom finger.
def finger_scan(posture: Posture, rng: np.random.Generator) -> Surface:
    """The phantom's scan in a posture: noisy, with holes, open at the cut end."""
    return Surface(*phantom_finger.skin_scan(phantom_finger.finger().posed(posture), rng))


def displaced_fingers(pose: str) -> Iterator[Case]:
    """Scans of the finger in its pose, displaced in every way."""
    posture = phantom_finger.posture(pose, SEED)
    true = Surface(*phantom_finger.finger().posed(posture).skin)
    for i in range(TIMES):
        rng = np.random.default_rng([7, POSES.index(pose), i])
        yield Case(f"finger, {pose} {i}", displaced(finger_scan(settled(posture, rng), rng), rng), true)


def wrong_fingers(pose: str) -> Iterator[Case]:
    """Scans of another finger, and of another pose."""
    posture = phantom_finger.posture(pose, SEED)
    rng = np.random.default_rng(11)
    scans = {f"scaled by {size:g}": _scaled(finger_scan(posture, rng), size) for size in (0.92, 1.08)}
    for name in ("MP2_flexion", "PIP2_flexion", "DIP2_flexion"):
        scans[f"{name} by 40 deg"] = finger_scan(bent(posture, {name: 40.0}), rng)
    for other in phantom_finger.POSES:
        if other != pose:
            scans[f"pose {other}"] = finger_scan(phantom_finger.posture(other, SEED), rng)
    if pose == "neutral":
        scans["phalanx longer by a fifth"] = _longer(finger_scan(posture, rng), 101.0, 124.0, 0.2)
        scans["thicker by a tenth"] = _thicker(finger_scan(posture, rng), 1.1)
    for name, scan in scans.items():
        yield Case(f"finger, {pose}, {name}", displaced(scan, rng), None)


def _scaled(scan: Surface, size: float) -> Surface:
    return scan.moved(size * scan.vertices)


def _longer(scan: Surface, start: float, end: float, share: float) -> Surface:
    """Longer along x between two places."""
    along = np.clip(scan.vertices[:, 0], start, end) - start
    return scan.moved(scan.vertices + share * along[:, None] * np.array([1.0, 0.0, 0.0]))


def _thicker(scan: Surface, size: float) -> Surface:
    return scan.moved(scan.vertices * np.array([1.0, size, size]))


# A whole hand, in any posture.
def hand_field(posture: Posture, spacing: float) -> tuple[Array, Grid]:
    """Distance in mm from the skin of the hand, negative inside, cut off at the wrist."""
    layout = phantom_hand.layout()
    moves = posture.transforms()
    rows = cone_rows(
        [*skin(layout), *hand_skin.flesh(layout)], {n: moves[n] @ f for n, f in layout.frames.items()}
    )
    home = posture.root.inverse()
    ends = home(rows[:, :6].reshape(-1, 3))
    kept = ends[:, 0].reshape(-1, 2).max(axis=1) > hand_skin.WRIST
    around = posture.root(ends[ends[:, 0] > hand_skin.WRIST - hand_skin.ROUNDING])
    grid = Grid.around(around, float(rows[:, 6:].max()) + 4.0, spacing)
    outline = field_of_cones(rows[kept], grid, hand_skin.BLEND).astype(float)
    beyond = hand_skin.WRIST - home(grid.points())[:, 0].reshape(grid.shape)
    return np.clip(np.maximum(outline, beyond), -hand_skin.KNOWN, hand_skin.KNOWN), grid


def hand_surface(posture: Posture) -> Surface:
    """The skin of the hand in a posture, with creases rounded."""
    field, grid = hand_field(posture, 1.1)
    return isosurface(gaussian_filter(field, hand_skin.CREASE / 1.1), grid).largest_component()


def hand_scan(posture: Posture, rng: np.random.Generator) -> Surface:
    """A scan of it: other triangles, noise, open at the wrist."""
    found = remesh(hand_surface(posture), TRIANGLES)
    kept = posture.root.inverse()(found.vertices)[:, 0] > hand_skin.WRIST + 8.0
    scan = Surface(found.vertices, found.triangles[kept[found.triangles].all(axis=1)]).compact()
    return scan.moved(scan.vertices + 0.03 * rng.standard_normal(scan.vertices.shape))


def hand_target(posture: Posture) -> ImageSkin:
    """The skin in a noisy image of the hand, with its true bones and joints under it."""
    field, grid = hand_field(posture, HAND_VOXEL)
    rng = np.random.default_rng(5)
    clean = np.clip(0.5 - gaussian_filter(field, hand_skin.CREASE / HAND_VOXEL) / HAND_VOXEL, 0.0, 1.0)
    noise = HAND_NOISE * rng.standard_normal((2, *clean.shape))
    affine = np.diag([HAND_VOXEL, HAND_VOXEL, HAND_VOXEL, 1.0])
    affine[:3, 3] = grid.origin
    seen = skin_of_volume(Volume(np.hypot(clean + noise[0], noise[1]).astype(np.float32), affine))
    posed = phantom_hand.hand().posed(posture)
    names = [posture.joints[0].parent, *WITH_ROOT]
    hinges = [SkinHinge(name, np.zeros(3), np.zeros((0, 3)), 0, i) for i, name in enumerate(names) if i]
    for joint in posture.joints:
        carried = posed.transforms[joint.parent]
        names.append(joint.child)
        ends = names.index(joint.parent), names.index(joint.child)
        hinges.append(SkinHinge(joint.name, carried(joint.centre), joint.axes @ carried.rotation.T, *ends))
    bones = {name: Surface(*posed.bones[name]) for name in names}
    return ImageSkin(seen.closed, uncut(seen), bones, hinges)


def displaced_hands(pose: str, posture: Posture) -> Iterator[Case]:
    """Scans of the hand in its pose, displaced in every way."""
    true = hand_surface(posture)
    for i in range(TIMES):
        rng = np.random.default_rng([8, HAND_POSES.index(pose), i])
        yield Case(f"hand, {pose} {i}", displaced(hand_scan(settled(posture, rng), rng), rng), true)


def wrong_hands(pose: str, posture: Posture) -> Iterator[Case]:
    """Scans of another hand, of the other side, and of another pose."""
    rng = np.random.default_rng(12)
    scan = hand_scan(posture, rng)
    scans = {f"scaled by {size:g}": _scaled(scan, size) for size in (0.92, 1.08)}
    scans["mirrored"] = scan.flipped().moved(scan.vertices * np.array([1.0, -1.0, 1.0]))
    for name in ("PIP2_flexion", "DIP5_flexion", "MP1_flexion"):
        scans[f"{name} by 40 deg"] = hand_scan(bent(posture, {name: 40.0}), rng)
    for other in ("flat", "fist"):
        scans[f"pose {other}"] = hand_scan(phantom_hand.posture(other, SEED), rng)
    for name, wrong in scans.items():
        yield Case(f"hand, {pose}, {name}", displaced(wrong, rng), None)
