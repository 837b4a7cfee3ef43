"""Level L3 in the scanned poses of a built finger: errors beside the full model and the uniform tissue."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, ConvergenceError, Frame, Metrics, Shapes, artifacts, paths
from handpipe.core.configuration import load_dataset
from handpipe.evaluation import surface_distance
from handpipe.hand import read_frames
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.posing import BoneLayer
from handpipe.skeleton.rig import Rig
from handpipe.tissues.fat import CreaseLayer, Skin, Tissue

SUBJECT = "phantom-finger"
MODELS = {"full": "m0", "uniform": "m2"}  # Zheng 2022 Table 4
STATISTICS: dict[str, Callable[[Array], float]] = {"mean": np.mean, "median": np.median, "max": np.max}
CUT = 2.0  # mm from the cut end, within which no distance counts
DATASET = Path(__file__).parents[2] / f"config/datasets/{SUBJECT}.yaml"
Errors = Mapping[str, Array]  # distances (n,) in mm by model


def creases(results: Path) -> Metrics:
    """Figures of level L3 over the example and the held-out poses of the finger."""
    finger = Finger.built(results)
    dataset = load_dataset(DATASET)
    found = finger.sizes()
    for role, poses in (("example", dataset.examples), ("heldout", dataset.heldout)):
        found |= {f"l3_{role}_{name}": value for name, value in _of_poses(finger, poses).items()}
    return found


@dataclass(frozen=True)
class Finger:
    """A built finger, its tissue with creases, and where it was cut off (mm)."""

    folder: Path
    rig: Rig
    layer: CreaseLayer
    cut: Array

    @staticmethod
    def built(results: Path) -> Finger:
        """The finger in a folder of results."""
        folder = results / SUBJECT
        rig, skin = Rig.load(folder / paths.below(paths.RIG)), Skin.load(folder / paths.below(paths.SKIN))
        tissue = Tissue.load(folder / paths.below(paths.CREASE_TISSUE))
        cut = skin.surface.vertices[skin.rigid["cut_end"].vertices]
        return Finger(folder, rig, CreaseLayer("skin", tissue), cut)

    def sizes(self) -> Metrics:
        """Tets, and vertices of the skin."""
        tissue = self.layer.tissue
        return {
            "l3_tets": (float(len(tissue.mesh.tets)), "tets"),
            "l3_skin_vertices": (float(len(tissue.skin.vertices)), "vertices"),
        }

    def frame(self, pose: str) -> Frame:
        """A scanned pose, the root at rest."""
        return Frame(pose, self.rig.poses[pose].angles, self.rig.scanned_bones(pose))

    def simulated(self, pose: str) -> Shapes:
        """The skin and the tissue in a scanned pose."""
        frame = self.frame(pose)
        return self.layer.solve(frame, {"bones": BoneLayer(self.rig.surfaces).solve(frame, {})})

    def true_points(self, pose: str) -> Array:
        """Vertices (n, 3) of the true skin of a pose but for the cut end, with the root bone at rest."""
        known = artifacts.read(self.folder / "data/truth" / f"{pose}.h5", "truth")["skin"]
        points: Array = self.rig.poses[pose].root.inverse()(known["vertices"])
        gaps = np.linalg.norm(points[:, None] - self.cut[None], axis=2).min(axis=1)
        return points[gaps > CUT]

    def built_skins(self, pose: str) -> dict[str, Surface]:
        """The skin of a pose by the other models."""
        models: dict[str, Shapes] = {}
        for pattern in (paths.POSE_SKIN, paths.POSE_PASSIVE_SKIN):
            [(_, found)] = read_frames(self.folder / paths.below(pattern, pose=pose))
            models |= found
        skins = {name: models[model]["skin"] for name, model in MODELS.items()}
        return {name: Surface(skin.vertices, skin.cells) for name, skin in skins.items()}


def _of_poses(finger: Finger, poses: Sequence[str]) -> Metrics:
    """Errors of all models over all points of the poses, and the cost and the folds of L3."""
    seconds, figures, errors = list[float](), list[dict[str, float]](), list[Errors]()
    failed = 0
    for pose in poses:
        begun = time.process_time()
        try:
            shapes = finger.simulated(pose)
        except ConvergenceError:
            failed += 1
            continue
        seconds.append(time.process_time() - begun)
        skin = shapes["skin"]
        figures.append(skin.figures | shapes["skin_mesh"].figures)
        skins = {"creases": Surface(skin.vertices, skin.cells), **finger.built_skins(pose)}
        points = finger.true_points(pose)
        errors.append({name: surface_distance(points, surface) for name, surface in skins.items()})
    found: Metrics = {"failed": (float(failed), "frames")}
    if not seconds:
        return found
    found |= {"seconds": (float(np.mean(seconds)), "s"), "seconds_max": (max(seconds), "s")}
    for name, unit in (("fold_depth", "mm"), ("fold_angle", "deg"), ("skin_crossings", "1")):
        found[f"{name}_max"] = (max(f[name] for f in figures), unit)
    found["inverted_tets"] = (sum(f["inverted_tets"] for f in figures), "tets")
    for model in ("creases", *MODELS):
        every = np.concatenate([found_in[model] for found_in in errors])
        for statistic, of in STATISTICS.items():
            found[f"{model}_error_{statistic}"] = (float(of(every)), "mm")
    return found
