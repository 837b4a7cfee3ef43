"""The neutral image moved into a scanned pose, beside the pose's own image, and how alike they are."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from handpipe.core import Array, Frame, RigidTransform, Shapes, write_text
from handpipe.core.configuration import Dataset
from handpipe.evaluation.moved_images import Row, anatomical_planes, write_slices
from handpipe.hand import places_in_neutral, read_frames
from handpipe.imaging.volumes import Volume, pose_volume, write_volume
from handpipe.imaging.warping import Places, Source, correlation, local_correlation
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files

WINDOW = 9.0  # mm, width of the windows of local correlations: some two phalanges' cortices


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    inner: Path
    skin: Path
    passive: Path
    neutral: Path
    volume: Path


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    volume: Path
    slices: Path
    table: Path


@dataclass(frozen=True)
class Pair:
    """The images of neutral and of a pose."""

    neutral: Volume
    posed: Volume

    def likeness(self, places: Places) -> dict[str, float]:
        """How alike they are where a voxel of the body was in the image of neutral."""
        used = places.imaged(self.neutral)
        values, own = places.values(self.neutral), places.at(self.posed)
        body = places.on_grid(used.astype(np.float64)).values > 0
        moved, width = places.on_grid(values).values, WINDOW / self.posed.spacing
        return {
            "correlation": correlation(values[used], own[used]),
            "local_correlation": local_correlation(
                moved.astype(np.float64), self.posed.values.astype(np.float64), body, width
            ),
            "imaged": float(used.mean()) if len(used) else 0.0,
        }


def move_image(inputs: Inputs, outputs: Outputs, dataset: Dataset, pose: str) -> None:
    """The neutral image moved into a scanned pose, beside the pose's own image, and how alike they are."""
    rig = Rig.load(inputs.rig)
    images = Pair(pose_volume(dataset, dataset.neutral), pose_volume(dataset, pose))
    [(frame, inner)] = read_frames(inputs.inner)
    [(_, skins)] = read_frames(inputs.skin)
    [(_, passive)] = read_frames(inputs.passive)
    root = rig.poses[pose].root
    layers = {**inner, "fat": skins["m0"]}
    models = {"layers": layers, "one_tissue": {"bones": inner["bones"], "skin": passive["m2"]}}
    found = {name: places_in_neutral(images.posed, frame, shapes, root) for name, shapes in models.items()}
    found["rigid"] = replace(found["layers"], rest=_moved_back(found["layers"], root))
    row: dict[str, str | float] = {"pose": pose, "role": dataset.poses[pose].role.value}
    for name, places in found.items():
        row |= {f"{figure}_{name}": value for figure, value in images.likeness(places).items()}
    row["filled"] = float((found["layers"].source == Source.gap).mean())
    write_text(outputs.table, json.dumps(row, indent=2))
    shown = {name: places.on_grid(places.values(images.neutral)) for name, places in found.items()}
    write_volume(outputs.volume, shown["layers"])
    _draw(outputs.slices, images, shown, root, (rig, frame, layers))


def _moved_back(places: Places, root: RigidTransform) -> Array:
    """Places at rest if all of the body moved with the root bone."""
    return root.inverse()(places.voxels @ places.affine[:3, :3].T + places.affine[:3, 3])


def _draw(
    path: Path,
    images: Pair,
    shown: Mapping[str, Volume],
    root: RigidTransform,
    simulated: tuple[Rig, Frame, Mapping[str, Shapes]],
) -> None:
    rig, frame, layers = simulated

    def row(name: str, volume: Volume, like: Volume) -> Row:
        return Row(name, lambda points: volume.sample(root(points)), (0.0, like.bright))

    rows = [
        row("scan", images.posed, images.posed),
        row("moved", shown["layers"], images.neutral),
        row("rigid", shown["rigid"], images.neutral),
    ]
    write_slices(path, rows, anatomical_planes(rig, frame, layers), layers)
