"""A real foot at three echo times: do its bones agree between the echoes, and with copies of an echo?

The echoes are one foot in one place: each bone of one must be that of another, and the motion between them
the identity, but for what the foot moved between the echoes. The strokes are drawn on one echo. Copies of
that echo are turned, noisier, or of thick slices. Registrations by surfaces and by images are compared; for
those by images the second echo is turned, since voxels that lie on one another would favour the identity.
"""

from __future__ import annotations

import logging
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from pathlib import Path

import numpy as np
from scipy import ndimage
from scipy.spatial.transform import Rotation

from benchmarks.scans.intensities import registered
from benchmarks.scans.strokes import write_strokes
from handpipe.core import RigidTransform
from handpipe.core.metrics import Metrics
from handpipe.imaging.bone_surfaces import outline_surface
from handpipe.imaging.learned import learned_doubts, segment_learned
from handpipe.imaging.segmentation import BACKGROUND, BoneProbability
from handpipe.imaging.volumes import Labels, Volume, read_labels, read_volume
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.bones.registration_result import Registration
from handpipe.skeleton.registration import PoseImages, register

log = logging.getLogger(__name__)

CHECKOUT = Path(__file__).parents[2]
STROKES = CHECKOUT / "tests" / "data" / "foot-strokes.json"
ECHOES = CHECKOUT.parent / "shared" / "data" / "real_mri" / "foot_dixon"
DRAWN_ON = 1  # of the echoes
TURN = 20.0  # deg
NOISIER = 1.5
MOST_TURN, MOST_SHIFT = 0.5, 0.3  # deg and mm: what a rig wants of a bone
PADDED = 20  # voxels around a turned image
LIKE = (0, 2)  # echoes of like contrast, fat against water
TISSUE = 0.15  # of bright tissue: darker voxels are air
AROUND = 5.0  # mm around a bone whose voxels are compared


@dataclass(frozen=True)
class Segmented:
    """The bones of one image.

    Parameters
    ----------
    volume : Volume
        The image.
    bones : dict of str to BoneProbability
        Its bones.
    doubts : dict of str to str
        Bones in doubt, and those that are missing.
    """

    volume: Volume
    bones: dict[str, BoneProbability]
    doubts: dict[str, str]

    @staticmethod
    def measure(volume: Volume, seeds: Labels, labels: Mapping[str, int]) -> Segmented:
        """Segment an image."""
        bones, wrong = segment_learned([volume], seeds, labels)
        return Segmented(volume, bones, wrong | learned_doubts(bones))

    def field(self, name: str) -> Volume:
        """The bone's probability in its box."""
        bone = self.bones[name]
        volume = self.volume.crop(bone.offset, bone.offset + bone.probability.shape)
        return volume.like(bone.probability)

    def surface(self, name: str) -> Surface:
        """The bone's surface."""
        return outline_surface(self.volume, self.bones[name])


@dataclass(frozen=True)
class Agreement:
    """How one bone of two images agrees: Dice coefficient, turn in deg and shift in mm beside the motion.

    `deviation` is that of the turn in deg, as the registration estimates it, which is `found`.
    """

    dice: float
    turn: float
    shift: float
    found: Registration

    @property
    def deviation(self) -> float:
        """Stated deviation of the turn in deg."""
        return float(self.found.rotation_deviation)

    @property
    def rigid(self) -> bool:
        """Whether the motion is the known one within the limits."""
        return self.turn <= MOST_TURN and self.shift <= MOST_SHIFT

    def __str__(self) -> str:
        return (
            f"Dice {self.dice:.3f}, turn {self.turn:.2f} deg (deviation {self.deviation:.2f}), "
            f"shift {self.shift:.2f} mm"
        )


def agreement(a: Segmented, b: Segmented, name: str, motion: RigidTransform) -> Agreement:
    """Agreement of a bone of `a`, moved, with that of `b`."""
    first, second = a.surface(name), b.surface(name)
    found = register(first, second, start=motion)
    return _compared(first, found, motion, _dice(a, b, name, motion))


def by_images(
    a: Segmented, moved: Volume, motion: RigidTransform, surfaces: Mapping[str, Agreement]
) -> dict[str, Agreement]:
    """The same of registrations that images refine: of bones of `a` with an image that is moved besides."""
    images = PoseImages(a.volume, moved, {name: a.surface(name) for name in a.bones})
    starts = {
        name: replace(one.found, transform=motion @ one.found.transform) for name, one in surfaces.items()
    }
    edges = {name: images.refined(name, start) for name, start in starts.items()}
    refined = {}
    for name, found in images.placed_together(edges).items():
        still = replace(found, transform=motion.inverse() @ found.transform)
        dice = surfaces[name].dice
        refined[name] = _compared(images.bones[name], still, RigidTransform.identity(), dice)
    return refined


def beside(a: Segmented, one: Agreement, name: str, motion: RigidTransform) -> Agreement:
    """The same registration against another motion."""
    return _compared(a.surface(name), one.found, motion, one.dice)


def _compared(bone: Surface, found: Registration, motion: RigidTransform, dice: float) -> Agreement:
    """A registration beside a motion."""
    middle = bone.vertices.mean(axis=0, keepdims=True)
    turn = Rotation.from_matrix(motion.rotation.T @ found.transform.rotation).magnitude()
    shift = float(np.linalg.norm(found.transform(middle) - motion(middle)))
    return Agreement(dice, float(np.degrees(turn)), shift, found)


def own_motion(a: Volume, b: Volume) -> RigidTransform:
    """How the whole foot moved between two images of like contrast, by the intensities of all its tissue."""
    tissue = ndimage.binary_opening(a.values > TISSUE * a.bright, iterations=2)
    return registered(a, b, tissue, [RigidTransform.identity()]).motion


def _dice(a: Segmented, b: Segmented, name: str, motion: RigidTransform) -> float:
    """Dice coefficient at the voxels of `a`."""
    low, high = a.surface(name).vertices.min(axis=0), a.surface(name).vertices.max(axis=0)
    grid = a.volume
    corners = grid.to_index(np.array(list(product(*zip(low - AROUND, high + AROUND, strict=True)))))
    lower = np.maximum(np.floor(corners.min(axis=0)), 0).astype(int)
    upper = np.minimum(np.ceil(corners.max(axis=0)) + 1, grid.shape).astype(int)
    points = grid.to_world(np.indices(upper - lower).reshape(3, -1).T + lower)
    own, other = a.field(name).sample(points) > 0.5, b.field(name).sample(motion(points)) > 0.5
    return float(2 * (own & other).sum() / max(int(own.sum() + other.sum()), 1))


def turned(volume: Volume, seeds: Labels) -> tuple[Volume, Labels, RigidTransform]:
    """A copy turned about the image's middle, on a grid that holds all of it; and the motion."""
    grid = np.array(volume.shape) + 2 * PADDED
    axis = np.ones(3) / np.sqrt(3)
    rotation = Rotation.from_rotvec(np.radians(TURN) * axis).as_matrix()
    middle = volume.to_world(np.array(volume.shape)[None] / 2)[0]
    motion = RigidTransform.about(middle, rotation)
    affine = volume.affine.copy()
    affine[:3, 3] = volume.to_world(np.full((1, 3), -PADDED))[0]
    copy = Volume(np.zeros(tuple(grid), np.float32), affine)
    points = copy.to_world(np.indices(copy.shape).reshape(3, -1).T)
    index = volume.to_index(motion.inverse()(points)).T
    values = ndimage.map_coordinates(volume.values, index, order=3).reshape(copy.shape)
    marks = ndimage.map_coordinates(seeds, index, order=0).reshape(copy.shape)
    return copy.like(np.maximum(values, 0)), marks, motion


def noisier(volume: Volume) -> Volume:
    """A copy with `NOISIER` times the noise."""
    added = noise(volume) * np.sqrt(NOISIER**2 - 1)
    random = np.random.default_rng(0).standard_normal((2, *volume.shape)) * added
    return volume.like(np.hypot(volume.values + random[0], random[1]))


def noise(volume: Volume) -> float:
    """The noise's deviation in tissue: of second differences along a diagonal, where edges are rare."""
    v = volume.values.astype(float)
    second = v[1:-1, 1:-1, 1:-1] - 0.5 * (v[:-2, :-2, :-2] + v[2:, 2:, 2:])
    tissue = v[1:-1, 1:-1, 1:-1] > 0.1 * volume.bright
    return float(np.median(np.abs(second[tissue])) / 0.6745 / np.sqrt(1.5))


def thick(volume: Volume, seeds: Labels) -> tuple[Volume, Labels]:
    """A copy of slices twice as thick along the first axis; voxels with strokes of two labels get none."""
    count = volume.shape[0] // 2
    pairs = volume.values[: 2 * count].reshape(count, 2, *volume.shape[1:])
    marks = seeds[: 2 * count].reshape(count, 2, *volume.shape[1:])
    affine = volume.affine.copy()
    affine[:3, 0] *= 2
    affine[:3, 3] = volume.to_world(np.array([[0.5, 0, 0]]))[0]
    low, high = marks.min(axis=1), marks.max(axis=1)
    return Volume(pairs.mean(axis=1), affine), np.where((low > 0) & (low < high), 0, high).astype(np.uint8)


def foot() -> tuple[list[Volume], Labels, dict[str, int]]:
    """The echoes, the strokes as voxels, and the bones' labels; no echoes without the shared data."""
    paths = sorted(ECHOES.glob("*.nii.gz"))
    if not paths:
        log.warning("%s has no images: nothing is measured", ECHOES)
        return [], np.zeros((0, 0, 0), np.uint8), {}
    with tempfile.TemporaryDirectory() as folder:
        labels = write_strokes(STROKES, paths[DRAWN_ON], Path(folder) / "seeds.nii.gz")
        volumes = [read_volume(path) for path in paths]
        return volumes, read_labels(Path(folder) / "seeds.nii.gz", volumes[DRAWN_ON]), labels


def measure(results: Path) -> Metrics:
    """Figures of agreement; none where the shared data are absent."""
    volumes, seeds, labels = foot()
    if not volumes:
        return {}
    start = time.perf_counter()
    echoes = [Segmented.measure(volume, seeds, labels) for volume in volumes]
    seconds = (time.perf_counter() - start) / len(echoes)
    sure = [name for name in labels if all(name not in echo.doubts for echo in echoes)]
    sure = [name for name in sure if all(echo.surface(name).is_closed() for echo in echoes)]
    still = RigidTransform.identity()
    found = {
        (a, b, name): agreement(echoes[a], echoes[b], name, still)
        for a, b in combinations(range(len(echoes)), 2)
        for name in sure
    }
    for (a, b, name), one in found.items():
        log.info("echoes %d, %d, %s: %s", a, b, name, one)
    rigid = [name for name in sure if all(one.rigid for (_, _, other), one in found.items() if other == name)]
    log.info("within %.1f deg and %.1f mm in all echoes: %s", MOST_TURN, MOST_SHIFT, ", ".join(rigid))
    figures: Metrics = {
        "foot_bones": (float(len(sure)), "1"),
        "foot_doubted": (float(len(labels) - len(sure)), "1"),
        "foot_rigid_bones": (float(len(rigid)), "1"),
        "foot_seconds": (seconds, "s"),
        "foot_strokes_share": (_share(seeds, echoes[DRAWN_ON]), "1"),
    }
    figures |= _figures("foot_echo", list(found.values()))
    figures |= _image_figures(echoes, found, seeds)
    original = echoes[DRAWN_ON]
    moved, marks, motion = turned(volumes[DRAWN_ON], seeds)
    copies = {
        "turned": (Segmented.measure(moved, marks, labels), motion),
        "noisier": (Segmented.measure(noisier(volumes[DRAWN_ON]), seeds, labels), still),
        "thick": (Segmented.measure(*thick(volumes[DRAWN_ON], seeds), labels), still),
    }
    for kind, (copy, known) in copies.items():
        both = [name for name in sure if name not in copy.doubts]
        compared = {name: agreement(original, copy, name, known) for name in both}
        for name, one in compared.items():
            log.info("%s, %s: %s", kind, name, one)
        figures[f"foot_{kind}_bones"] = (float(len(both)), "1")
        figures |= _figures(f"foot_{kind}", list(compared.values()))
        figures |= _copy_figures(kind, original, copy, known, compared)
    return figures


def _copy_figures(
    kind: str, original: Segmented, copy: Segmented, known: RigidTransform, surfaces: Mapping[str, Agreement]
) -> Metrics:
    """Figures of registrations that images refine, of a copy that is turned besides where it is not."""
    back = known.inverse()
    moved, motion = copy.volume, known
    if known.angle_to(RigidTransform.identity()) == 0:
        moved, _, motion = turned(copy.volume, np.zeros(copy.volume.shape, np.uint8))
    still = {
        name: replace(one, found=replace(one.found, transform=back @ one.found.transform))
        for name, one in surfaces.items()
    }
    refined = by_images(original, moved, motion, still)
    for name, one in refined.items():
        log.info("by images, %s, %s: %s", kind, name, one)
    return _figures(f"foot_{kind}_images", list(refined.values()))


def _share(seeds: Labels, segmented: Segmented) -> float:
    """Strokes of bones over the bones' voxels."""
    voxels = sum(int((bone.probability > 0.5).sum()) for bone in segmented.bones.values())
    return float(((seeds > 0) & (seeds < BACKGROUND)).sum() / voxels)


def _image_figures(
    echoes: Sequence[Segmented], found: Mapping[tuple[int, int, str], Agreement], seeds: Labels
) -> Metrics:
    """Figures of registrations that images refine, between echoes; those of like contrast besides."""
    every: list[Agreement] = []
    figures: Metrics = {}
    for a, b in combinations(range(len(echoes)), 2):
        surfaces = {name: one for (i, j, name), one in found.items() if (i, j) == (a, b)}
        moved, _, motion = turned(echoes[b].volume, seeds)
        refined = by_images(echoes[a], moved, motion, surfaces)
        figures[f"foot_images_rigid_bones_{a}_{b}"] = (float(sum(one.rigid for one in refined.values())), "1")
        for name, one in refined.items():
            log.info("by images, echoes %d, %d, %s: %s", a, b, name, one)
        every += refined.values()
        if (a, b) == LIKE:
            own = own_motion(echoes[a].volume, echoes[b].volume)
            figures["foot_like_moved"] = (float(np.degrees(own.angle_to(RigidTransform.identity()))), "deg")
            figures |= _figures("foot_like_images", list(refined.values()))
            against = [beside(echoes[a], one, name, own) for name, one in refined.items()]
            figures |= _figures("foot_like_images_own", against)
            figures["foot_like_rigid_bones"] = (float(sum(one.rigid for one in against)), "1")
            surfaces = {name: beside(echoes[a], one, name, own) for name, one in surfaces.items()}
            figures |= _figures("foot_like_surfaces_own", list(surfaces.values()))
    return figures | _figures("foot_echo_images", every)


def _figures(name: str, found: Sequence[Agreement]) -> Metrics:
    """Smallest Dice coefficient, largest turn and shift, and what the stated deviations say of the turns."""
    ratios = np.array([one.turn / one.deviation for one in found])
    dice, turns = [one.dice for one in found], [one.turn for one in found]
    return {
        f"{name}_dice_min": (min(dice), "1"),
        f"{name}_dice_mean": (float(np.mean(dice)), "1"),
        f"{name}_rotation_max": (max(turns), "deg"),
        f"{name}_rotation_median": (float(np.median(turns)), "deg"),
        f"{name}_shift_max": (max(one.shift for one in found), "mm"),
        f"{name}_rotation_by_deviation": (float(np.sqrt((ratios**2).mean())), "1"),
        f"{name}_rotation_within_two_deviations": (float((ratios < 2).mean()), "1"),
    }
