"""A subject by `handpipe init` from raw scans, against the same subject from its generator's own templates.

The raw scans are those of a built generated subject as a scanner writes them: tilted DICOM, skins as STL,
strokes in neutral alone. Bones, joints and organs are the template hand's, not the generator's. Both builds
are compared with the same truth. Muscles are not: those of the template have no counterpart in the truth.

`python -m benchmarks.scans from_raw` takes one finger; `python -m benchmarks.scans.from_raw --hand` the hand,
`--left` its mirror image as a left hand.
"""

from __future__ import annotations

import argparse
import logging
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from handpipe.core import Array, Metrics, RigidTransform, metrics
from handpipe.core.configuration import Dataset, Role, load_dataset
from handpipe.develop.raw_scans import scanner_transform
from handpipe.skeleton.bones import read_registrations
from handpipe.skeleton.rig import Rig
from handpipe.stages.poses import flesh_in_poses
from handpipe.stages.truth import bone_errors, true_pose
from handpipe.tissues.tendons import Tendon
from handpipe.tissues.tendons.fitting import centreline_errors

log = logging.getLogger("benchmarks.scans.from_raw")

CHECKOUT = Path(__file__).parents[2]
PROJECT = ("Snakefile", "workflow", "config", "profiles")
RAW = "raw"
SKIN = {
    "skin_example": "example_error_mean",
    "skin_heldout": "heldout_error_mean",
}  # names in metrics/skin.json


@dataclass(frozen=True)
class Case:
    """A generated subject, and how its raw scans become another one.

    Parameters
    ----------
    plain : str
        The generated subject; its results are built.
    name : str
        The subject that `init` makes.
    part : str or None
        Value of `--only`.
    overlay : str
        Configuration with the meshes of the plain subject.
    hand : str
        "right", as the generated subject, or "left": its scans are mirrored.
    """

    plain: str
    name: str
    part: str | None
    overlay: str
    hand: str = "right"

    @property
    def mirrored(self) -> bool:
        """Whether the scans are those of the other hand."""
        return self.hand == "left"

    def typed(self, heldout: Sequence[str]) -> list[str]:
        """Arguments of `handpipe init`."""
        part = [] if self.part is None else ["--only", self.part]
        tested = [word for pose in heldout for word in ("--heldout", pose)]
        return [self.name, "--volumes", RAW, "--hand", self.hand, *part, *tested]


FINGER = Case("phantom-finger", "my-finger", "index", "config/finger.yaml")
HAND = Case("phantom-hand-preview", "my-hand", None, "config/config.yaml")
LEFT = Case("phantom-hand-preview", "my-left-hand", None, "config/config.yaml", "left")


@dataclass(frozen=True)
class Build:
    """A built subject in a folder of results, with the map (4, 4) from the truth's frame into its own."""

    folder: Path
    dataset: Dataset
    transform: Array = field(default_factory=lambda: np.eye(4))

    def from_truth(self, points: Array) -> Array:
        """Points (n, 3) of the truth in its own frame."""
        return np.asarray(points @ self.transform[:3, :3].T + self.transform[:3, 3])

    def to_truth(self, points: Array) -> Array:
        """Points (n, 3) of its own in the truth's frame."""
        return np.asarray(np.linalg.solve(self.transform[:3, :3], (points - self.transform[:3, 3]).T).T)

    def motion_in_truth(self, motion: RigidTransform) -> RigidTransform:
        """A motion of its own in the truth's frame, also where that is its mirror image."""
        own = np.eye(4)
        own[:3, :3], own[:3, 3] = motion.rotation, motion.translation
        found: Array = np.linalg.solve(self.transform, own @ self.transform).astype(np.float64)
        return RigidTransform(found[:3, :3], found[:3, 3])

    def rig(self) -> Rig:
        """Its fitted rig."""
        return Rig.load(self.folder / "rig.h5")


def measure(results: Path) -> Metrics:
    """Figures of one finger, whose plain build is in a folder of results."""
    return compared(FINGER, results)


def compared(case: Case, results: Path) -> Metrics:
    """Build a case from raw scans, in a folder below the results, and compare it with the plain one."""
    folder = results.resolve() / "benchmarks" / "from_raw" / case.name
    plain = load_dataset(CHECKOUT / f"config/datasets/{case.plain}.yaml")
    heldout = plain.poses_of(Role.heldout)
    arrange(case, results.resolve(), folder)
    if not (folder / f"config/datasets/{case.name}.yaml").exists():
        run(folder, "handpipe.cli", "init", *case.typed(heldout))
    run(folder, "handpipe.cli", "check", case.name)
    scene = ["--configfile", case.overlay, "--scene", case.name]
    run(folder, "handpipe.cli", "build", case.name, *scene, "--cores", "1")
    dataset = load_dataset(folder / f"config/datasets/{case.name}.yaml")
    own = Build(folder / "results" / case.name, dataset, scanner_transform(mirrored=case.mirrored))
    found = ratios(Build(results.resolve() / case.plain, plain), own)
    typed = [word for word in case.typed(heldout) if not word.startswith("--")]
    return {"typed_values": (float(len(typed)), "1")} | found


def copy_workflow(folder: Path) -> None:
    """Copy the project's workflow to a folder; what else is there is kept."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in PROJECT:
        source = CHECKOUT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, dirs_exist_ok=True)
        else:
            shutil.copy(source, folder / name)


def arrange(case: Case, results: Path, folder: Path) -> None:
    """The project's workflow in a folder, beside raw scans of the plain subject; what is there is kept."""
    copy_workflow(folder)
    link = folder / "results" / case.plain
    link.parent.mkdir(exist_ok=True)
    if not link.exists():
        link.symlink_to(results / case.plain, target_is_directory=True)
    if not (folder / RAW).exists():
        mirrored = ["--mirrored"] if case.mirrored else []
        run(folder, "handpipe.develop.raw_scans", case.plain, RAW, "--strokes", *mirrored)


def run(folder: Path, module: str, *arguments: str) -> None:
    """Run a command of handpipe in a folder; `CalledProcessError` if it fails."""
    log.info("%s %s", module, " ".join(arguments))
    here = os.pathsep.join([str(CHECKOUT / "src"), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", module, *arguments]
    subprocess.run(command, cwd=folder, env=os.environ | {"PYTHONPATH": here}, check=True)


@dataclass(frozen=True)
class Truth:
    """The truth of a generated subject's poses."""

    dataset: Dataset
    folder: Path

    def file(self, pose: str) -> Path:
        """Its file of a pose."""
        return self.folder / f"{pose}.h5"


def ratios(plain: Build, own: Build) -> Metrics:
    """Errors of both builds, and those of the second over those of the first."""
    truth = Truth(plain.dataset, plain.folder / "data/truth")
    before, after = errors(plain, truth), errors(own, truth)
    found: Metrics = {}
    for name, (value, unit) in after.items():
        ratio = value / before[name][0]
        found |= {f"raw_{name}": (value, unit), f"plain_{name}": before[name], f"ratio_{name}": (ratio, "1")}
    shares = [value for name, (value, _) in found.items() if name.startswith("ratio_")]
    return found | {"figures_ratio_max": (max(shares), "1")}


def errors(build: Build, truth: Truth) -> Metrics:
    """Mean errors by role of the poses: of bones and tendons against the truth, of the skin against scans."""
    skin = metrics.read(build.folder / "metrics/skin.json")
    found: Metrics = {name: skin[figure] for name, figure in SKIN.items()}
    for role in (Role.example, Role.heldout):
        poses = truth.dataset.poses_of(role)
        turns, shifts = bones_off(build, truth, poses)
        lines = tendons_off(build, truth, poses)
        found[f"bone_rotation_{role.value}"] = (float(np.mean(turns)), "deg")
        found[f"bone_translation_{role.value}"] = (float(np.mean(shifts)), "mm")
        turns, shifts = registered_off(build, truth, poses)
        found[f"registered_rotation_{role.value}"] = (float(np.mean(turns)), "deg")
        found[f"registered_translation_{role.value}"] = (float(np.mean(shifts)), "mm")
        if len(lines):
            found[f"tendons_{role.value}"] = (float(lines.mean()), "mm")
    return found


def bones_off(build: Build, truth: Truth, poses: Sequence[str]) -> tuple[list[float], list[float]]:
    """Turns in deg and distances of middles in mm of the rig's bones from the true ones, by pose and bone."""
    rig = build.rig()
    moved = {pose: rig.bone_transforms(rig.poses[pose].angles, rig.poses[pose].root) for pose in poses}
    return _off(build, rig, truth, moved)


def registered_off(build: Build, truth: Truth, poses: Sequence[str]) -> tuple[list[float], list[float]]:
    """The same of each bone as it is registered, alone; bones in doubt are left out."""
    found = {pose: read_registrations(build.folder / f"registration/{pose}.h5") for pose in poses}
    moved = {p: {b: r.transform for b, r in bones.items() if not r.doubt} for p, bones in found.items()}
    return _off(build, build.rig(), truth, moved)


def _off(
    build: Build, rig: Rig, truth: Truth, moved: Mapping[str, Mapping[str, RigidTransform]]
) -> tuple[list[float], list[float]]:
    """Of motions in the build's frame by pose and bone."""
    turns, shifts = [], []
    middles = {b: build.to_truth(surface.centroid()[None])[0] for b, surface in rig.surfaces.items()}
    for pose, bones in moved.items():
        found = {bone: build.motion_in_truth(motion) for bone, motion in bones.items()}
        seen = {bone: middle for bone, middle in middles.items() if bone in found}
        angles, distances = bone_errors([truth.file(pose)], pose, found, seen)
        turns += angles
        shifts += distances
    return turns, shifts


def tendons_off(build: Build, truth: Truth, poses: Sequence[str]) -> Array:
    """Distances (n,) in mm between simulated rods and true centrelines, both ways."""
    return np.concatenate([np.zeros(0), *_tendons_off(build, truth, poses)])


def _tendons_off(build: Build, truth: Truth, poses: Sequence[str]) -> Iterator[Array]:
    rig = build.rig()
    files = {pose: build.folder / f"poses/{pose}/flesh.h5" for pose in poses}
    flesh = {p: s.vertices for p, s in flesh_in_poses(f for f in files.values() if f.exists()).items()}
    for name in build.dataset.tendons:
        tendon = Tendon.load(build.folder / f"tendons/{name}/hooks.h5")
        for pose in poses:
            rod = tendon.solve(rig.scanned_bones(pose), flesh.get(pose)).x
            true = true_pose([truth.file(pose)], pose)["tendons"][name]["centreline"]
            yield from centreline_errors(rod, rig.poses[pose].root.inverse()(build.from_truth(true)))


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the figures of one case."""
    parser = argparse.ArgumentParser(prog="benchmarks.scans.from_raw", description=__doc__)
    parser.add_argument("--hand", action="store_true", help="the whole generated hand; half an hour and more")
    parser.add_argument("--left", action="store_true", help="its mirror image, a left hand")
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of built subjects")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    case = LEFT if options.left else HAND if options.hand else FINGER
    for name, (value, unit) in compared(case, options.results).items():
        print(f"{name} {value:.4g} {unit}")


if __name__ == "__main__":
    main()
