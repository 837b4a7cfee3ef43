"""A made-up subject that takes a second a bone: two rods of bright marrow in dark cortical bone.

Each rod has a knob on one side of one end: a rod that fits as well turned by 180 degrees is rightly doubted.
"""

import json
from pathlib import Path
from typing import Any

import nibabel
import numpy as np
import trimesh
import yaml

LABELS = {"near": 1, "far": 2}
POSES = ("flat", "bent")
SPACING = 0.8
AFFINE = np.diag([SPACING, SPACING, SPACING, 1.0])
MIDDLE = {"near": (11.0, 14.5, 14.5), "far": (29.0, 14.5, 14.5)}  # voxels
RADIUS, REACH = 3.0, 4.0  # of a rod and of its half axis, voxels
KNOB = (4.0, 3.0, 0.0)  # from a rod's middle, voxels
SHAPE = (40, 30, 30)


def distance_to(bone: str) -> np.ndarray:
    """Distance of every voxel from a bone's axis or the middle of its knob, in voxels."""
    places = np.moveaxis(np.indices(SHAPE), 0, -1) - MIDDLE[bone]
    x, y, z = np.moveaxis(places, -1, 0)
    rod = np.sqrt(np.maximum(np.abs(x) - REACH, 0) ** 2 + y**2 + z**2)
    return np.minimum(rod, np.linalg.norm(places - KNOB, axis=-1))


def image() -> np.ndarray:
    """Marrow 100 and cortical bone 8 in muscle of 45."""
    values = np.full(SHAPE, 45.0, dtype=np.float32)
    for bone in LABELS:
        distance = distance_to(bone)
        values[distance < RADIUS + 2] = 8.0
        values[distance < RADIUS] = 100.0
    return values


def seeds() -> np.ndarray:
    """A stroke along each bone's axis, and the background far from both."""
    labels = np.zeros(SHAPE, dtype=np.uint8)
    labels[np.minimum(distance_to("near"), distance_to("far")) > RADIUS + 4] = 255
    for bone, label in LABELS.items():
        labels[distance_to(bone) < 1] = label
    return labels


def write_image(path: Path, values: np.ndarray, affine: np.ndarray = AFFINE) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    nibabel.save(nibabel.Nifti1Image(values, affine), path)


def write_mesh(path: Path, mesh: trimesh.Trimesh) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    mesh.export(path)


def ball() -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=2, radius=8.0)


def body() -> trimesh.Trimesh:
    """The skin: all of the image is body."""
    box = trimesh.creation.box(SPACING * np.array(SHAPE))
    return box.apply_translation(SPACING * (np.array(SHAPE) - 1) / 2)


def opened(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh without a few of its triangles."""
    return trimesh.Trimesh(mesh.vertices, mesh.faces[5:], process=False)


def write_subject(folder: Path) -> dict[str, Any]:
    """Write the subject "small" into a working copy, and its dataset file; return that file's content."""
    data = folder / "small"
    for pose in POSES:
        write_image(data / f"{pose}.nii.gz", image())
        write_image(data / f"{pose}-seeds.nii.gz", seeds())
        write_mesh(data / f"{pose}.ply", body())
    write_image(data / "bent-far.nii.gz", np.zeros(SHAPE, np.uint8))  # scribbles, none drawn yet
    for name in ("near", "far", "flexor"):
        write_mesh(data / f"{name}.ply", ball())
    (data / "flexor.json").write_text(json.dumps({"near": [0, 1, 2, 3], "far": [10, 11, 12, 13]}))
    dataset = {
        "name": "small",
        "root": "small",
        "poses": {
            pose: {
                "role": "neutral" if pose == POSES[0] else "example",
                "volume": f"{pose}.nii.gz",
                "seeds": f"{pose}-seeds.nii.gz",
                "scan": f"{pose}.ply",
            }
            | ({"scribbles": {"far": "bent-far.nii.gz"}} if pose == "bent" else {})
            for pose in POSES
        },
        "bones": {bone: {"label": label, "template": f"{bone}.ply"} for bone, label in LABELS.items()},
        "joints": {
            "hinge": {
                "parent": "near",
                "child": "far",
                "angles": ["hinge_flexion"],
                "limits_deg": [[-10, 90]],
                "axis_hints": [[0, 1, 0]],
            }
        },
        "muscles": {"flexor": {"template": "flexor.ply", "attachments": "flexor.json"}},
    }
    write_dataset(folder, dataset)
    return dataset


def write_dataset(folder: Path, dataset: dict[str, Any]) -> None:
    text = yaml.safe_dump(dataset, sort_keys=False)
    (folder / "config" / "datasets" / "small.yaml").write_text(text)
