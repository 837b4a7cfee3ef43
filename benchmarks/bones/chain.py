"""From one scan to its bones' surfaces and transforms, as the workflow's jobs do it, in this process."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from benchmarks.bones.notices import listening
from benchmarks.bones.subject import Scan
from handpipe.config import Dataset
from handpipe.imaging.cortical import whole_bone
from handpipe.imaging.marrow import marrow_surface
from handpipe.imaging.segmentation import BoneProbability, SegmentationSettings, merge, segment_bone
from handpipe.mesh.surface import Surface
from handpipe.skeleton.pose_registration import register_pose, unmoved
from handpipe.skeleton.registration_result import Registration

EVERY = "all bones"


@dataclass
class Notes:
    """What was said of each bone, and the processor's seconds that it took."""

    said: dict[str, list[str]] = field(default_factory=dict)
    seconds: float = 0.0

    @contextmanager
    def of(self, bone: str) -> Iterator[None]:
        """Times the block and listens to what is said in it; errors for people end the block alone."""
        heard: list[str] = []
        begun = time.process_time()
        with listening(heard):
            yield
        self.seconds += time.process_time() - begun
        if heard:
            self.said.setdefault(bone, []).extend(heard)


@dataclass
class Segmented:
    """Surfaces of the bones that were found in a pose: of the marrow, and in neutral of the whole bone."""

    marrow: dict[str, Surface]
    whole: dict[str, Surface]
    notes: Notes


@dataclass
class Registered:
    """Registrations of the bones that were found in a pose, from neutral."""

    found: dict[str, Registration]
    notes: Notes

    def trusted(self) -> dict[str, Registration]:
        """What the rig may learn from: registrations in doubt are not among them."""
        return {bone: r for bone, r in self.found.items() if not r.doubt}


def segment(scan: Scan, settings: SegmentationSettings, *, neutral: bool) -> Segmented:
    """Bones of one scan; what fails for one bone leaves the others alone."""
    notes, claims = Notes(), dict[int, BoneProbability]()
    for bone, label in scan.labels.items():
        with notes.of(bone):
            claims[label] = segment_bone(scan.volume, scan.seeds, label, settings)
    with notes.of(EVERY):
        _, claims = merge(scan.volume, claims, scan.seeds, settings)
    names = {label: bone for bone, label in scan.labels.items()}
    marrow: dict[str, Surface] = {}
    whole: dict[str, Surface] = {}
    for label, claim in claims.items():
        with notes.of(names[label]):
            marrow[names[label]] = marrow_surface(scan.volume, claim)
    for label, claim in claims.items() if neutral else ():
        bone = names[label]
        if bone in marrow:
            others = [surface for other, surface in marrow.items() if other != bone]
            with notes.of(bone):
                whole[bone] = whole_bone(scan.volume, claim, marrow[bone], others)
    return Segmented(marrow, whole, notes)


def register(dataset: Dataset, neutral: Segmented, pose: Segmented) -> Registered:
    """Registrations of the bones of one pose, and what was said of each; neutral is where it is."""
    if pose is neutral:
        return Registered(unmoved(neutral.marrow), Notes())
    notes, found = Notes(), dict[str, Registration]()
    with notes.of(EVERY):
        found = register_pose(dataset, neutral.marrow, pose.marrow)
    for text in notes.said.pop(EVERY, []):
        named = [bone for bone in dataset.bones if text.startswith(bone)]
        notes.said.setdefault(named[0] if named else EVERY, []).append(text)
    return Registered(found, notes)
