"""A wrist of fifteen real bone shapes by the commands that a person gives, against its known motions.

`python -m benchmarks.scans.wrist --results FOLDER`: `handpipe init`, `check` and `build` of volumes of
`real_wrist`, with strokes of neutral alone, and the errors of registrations, rig and skin.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.scans.from_raw import copy_workflow, run
from benchmarks.scans.real_wrist import HELDOUT, POSES, SEEN, SOURCE, Wrist
from handpipe.core import Array, Metrics, RigidTransform, Shapes
from handpipe.evaluation import surface_distance
from handpipe.hand import StoredFrames
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import TetMesh
from handpipe.skeleton.bones import read_registrations
from handpipe.skeleton.rig import Rig

NAME, RAW = "my-wrist", "mine"
SPACING = 0.7  # mm
BESIDE = 4.0  # mm from the ends of the neutral skin: what lies nearer is not compared


def built(folder: Path, wrist: Wrist, spacing: float = SPACING) -> Metrics:
    """Build the wrist in a folder, where what is there is kept, and compare it with the truth."""
    copy_workflow(folder)
    if not (folder / RAW).exists():
        wrist.write(folder / RAW, tuple(POSES), spacing)
    if not (folder / f"config/datasets/{NAME}.yaml").exists():
        heldout = [word for pose in HELDOUT for word in ("--heldout", pose)]
        typed = [NAME, "--volumes", RAW, "--hand", "right", *heldout, *wrist.asked]
        run(folder, "handpipe.cli", "init", *typed)
    run(folder, "handpipe.cli", "check", NAME)
    run(folder, "handpipe.cli", "build", NAME, "--scene", NAME, "--cores", "1")
    return compared(folder / "results" / NAME, wrist)


def compared(results: Path, wrist: Wrist) -> Metrics:
    """Largest errors of registered bones and of the rig, and errors of the skin in the scanned poses."""
    rig = Rig.load(results / "rig.h5")
    errors = {"rig": rig_errors(wrist, rig), "registered": registration_errors(wrist, results)}
    found: Metrics = {}
    for kind, rows in errors.items():
        turns, shifts = np.array([*rows.values()]).T
        found |= {f"{kind}_rotation_max": (float(turns.max()), "deg")}
        found |= {f"{kind}_rotation_mean": (float(turns.mean()), "deg")}
        found |= {f"{kind}_translation_max": (float(shifts.max()), "mm")}
    frames = {frame.name: shapes for frame, shapes in _frames(results)}
    unbent = frames["neutral"]["skin"]["skin"]
    found["frames"] = (float(len(frames)), "frames")
    inverted = sum(inverted_tets(shapes["skin"]) for shapes in frames.values())
    found["inverted_tets"] = (float(inverted), "1")
    for pose in (name for name in frames if name in POSES and name != "neutral"):
        skin = frames[pose]["skin"]["skin"]
        after = skin_errors(wrist, rig, pose, unbent.vertices, skin.vertices)
        before = skin_errors(wrist, rig, pose, unbent.vertices, unbent.vertices)
        found[f"skin_{pose}_mean"] = (float(after.mean()), "mm")
        found[f"skin_{pose}_p95"] = (float(np.percentile(after, 95)), "mm")
        found[f"skin_{pose}_before"] = (float(before.mean()), "mm")
    return found


def _frames(results: Path) -> StoredFrames:
    files = (results / "simulation" / NAME).glob("frames-*.h5")
    chunks = {int(path.stem.split("-")[-1]): path for path in files}
    return StoredFrames(chunks[number] for number in sorted(chunks))


def rig_errors(wrist: Wrist, rig: Rig) -> dict[tuple[str, str], tuple[float, float]]:
    """Turn in deg and shift in mm of each bone off its true motion by pose and bone, as the rig has it."""
    moved = {
        pose: rig.bone_transforms(known.angles, known.root)
        for pose, known in rig.poses.items()
        if pose != "neutral"
    }
    return _errors(wrist, moved)


def registration_errors(wrist: Wrist, results: Path) -> dict[tuple[str, str], tuple[float, float]]:
    """The same of each bone as it is registered; bones in doubt are left out."""
    moved = {}
    for pose in (pose for pose in POSES if pose != "neutral"):
        found = read_registrations(results / f"registration/{pose}.h5")
        moved[pose] = {bone: r.transform for bone, r in found.items() if not r.doubt}
    return _errors(wrist, moved)


def _errors(
    wrist: Wrist, moved: Mapping[str, Mapping[str, RigidTransform]]
) -> dict[tuple[str, str], tuple[float, float]]:
    found = {}
    for pose, bones in moved.items():
        true = wrist.motions(pose)
        for bone, motion in bones.items():
            points = wrist.bones[bone][0]
            middle = points[(points[:, 0] > SEEN[0]) & (points[:, 0] < SEEN[1])].mean(axis=0)[None]
            turn = Rotation.from_matrix(motion.rotation.T @ true[bone].rotation).magnitude()
            shift = np.linalg.norm(motion(middle) - true[bone](middle))
            found[pose, bone] = float(np.degrees(turn)), float(shift)
    return found


def skin_errors(wrist: Wrist, rig: Rig, pose: str, neutral: Array, simulated: Array) -> Array:
    """Distances (k,) in mm from the true skin of vertices (n, 3) of a skin, but for those near its ends.

    neutral (n, 3): where these vertices are in neutral; the pose is that of the root at rest.
    """
    points, triangles = wrist.skin[0]
    home = rig.poses[pose].root.inverse()
    ends = (neutral[:, 0] > SEEN[0] + BESIDE) & (neutral[:, 0] < SEEN[1] - BESIDE)
    return np.asarray(surface_distance(simulated[ends], Surface(home(wrist.bent(pose, points)), triangles)))


def inverted_tets(shapes: Shapes) -> int:
    """Number of inverted tets of a tissue's shapes."""
    mesh = shapes["skin_mesh"]
    return int((TetMesh(mesh.vertices, mesh.cells).volumes() <= 0).sum())


def main(arguments: Sequence[str] | None = None) -> None:
    """Build the wrist and print its figures."""
    parser = argparse.ArgumentParser(prog="benchmarks.scans.wrist", description=__doc__)
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of built subjects")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    folder = options.results.resolve() / "benchmarks" / "wrist"
    for name, (value, unit) in built(folder, Wrist(SOURCE)).items():
        print(f"{name} {value:.4g} {unit}")


if __name__ == "__main__":
    main()
