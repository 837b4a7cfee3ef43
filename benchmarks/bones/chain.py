"""From one scan to its bones' surfaces and transforms, as the workflow's jobs do it, in this process."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from benchmarks.bones.notices import listening
from benchmarks.bones.subject import Scan
from handpipe.core.configuration import Dataset
from handpipe.imaging.bone_surfaces import blurred_shells, marrow_surface, whole_bone
from handpipe.imaging.segmentation import Appearance, SegmentationSettings, merge
from handpipe.imaging.segmentation import segment as claimed
from handpipe.imaging.segmentation.claims import appearances, doubted
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.bones.registration_result import Registration
from handpipe.skeleton.registration import register_pose, unmoved

log = logging.getLogger("handpipe.benchmarks.bones")  # the library's, which benchmarks listen to
EVERY = "all bones"


@dataclass
class Notes:
    """What was said of each bone, and the processor's seconds that it took."""

    said: dict[str, list[str]] = field(default_factory=dict)
    seconds: float = 0.0

    @contextmanager
    def naming(self, bones: Iterable[str]) -> Iterator[None]:
        """Times the block and listens: what begins with a bone's name is said of it, the rest of all bones.

        An error for people ends the block alone.
        """
        heard: list[str] = []
        begun = time.process_time()
        with listening(heard):
            yield
        self.seconds += time.process_time() - begun
        for text in heard:
            named = next((bone for bone in bones if text.startswith(bone)), EVERY)
            self.said.setdefault(named, []).append(text)


@dataclass(frozen=True, eq=False)
class Segmented:
    """Surfaces of the bones that were found in a pose, and how they look in its image.

    marrow; whole: in neutral alone.
    """

    marrow: dict[str, Surface]
    whole: dict[str, Surface]
    looks: dict[str, Appearance]
    notes: Notes


@dataclass(frozen=True, eq=False)
class Registered:
    """Registrations of the bones that were found in a pose, from neutral."""

    found: dict[str, Registration]
    notes: Notes

    def trusted(self) -> dict[str, Registration]:
        """What the rig may learn from: registrations in doubt are not among them."""
        return {bone: r for bone, r in self.found.items() if not r.doubt}


def segment(scan: Scan, settings: SegmentationSettings, neutral: Segmented | None) -> Segmented:
    """Bones of one scan, without those that the library doubts; neutral: how they look there, but there."""
    notes, looks = Notes(), dict[str, Appearance]()
    marrow: dict[str, Surface] = {}
    whole: dict[str, Surface] = {}
    with notes.naming(scan.labels):
        alone, _ = claimed(scan.volume, scan.seeds, scan.labels, settings)
        by_label = {scan.labels[bone]: claim for bone, claim in alone.items()}
        _, merged = merge(scan.volume, by_label, scan.seeds, settings)
        bones = {bone: merged[label] for bone, label in scan.labels.items() if label in merged}
        looks = appearances(scan.volume, bones)
        wrong = doubted(looks, neutral.looks if neutral else {})
        bones = {bone: claim for bone, claim in bones.items() if bone not in wrong}
        marrow |= {bone: marrow_surface(scan.volume, claim) for bone, claim in bones.items()}
        for bone, claim in bones.items() if neutral is None else ():
            others = [surface for other, surface in marrow.items() if other != bone]
            whole[bone] = whole_bone(scan.volume, claim, marrow[bone], others)
        for bone, reason in blurred_shells(scan.volume, marrow, whole).items():
            log.warning("%s: %s", bone, reason)
    return Segmented(marrow, whole, looks, notes)


def register(dataset: Dataset, neutral: Segmented, pose: Segmented) -> Registered:
    """Registrations of the bones of one pose, and what was said of each; neutral is where it is."""
    if pose is neutral:
        return Registered(unmoved(neutral.marrow), Notes())
    notes, found = Notes(), dict[str, Registration]()
    with notes.naming(dataset.bones):
        found = register_pose(dataset, neutral.marrow, pose.marrow)
    return Registered(found, notes)
