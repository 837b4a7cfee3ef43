"""Skin of volumes: against the true skin of a generated finger, and between the echoes of a real foot."""

from __future__ import annotations

import tempfile
from itertools import permutations
from pathlib import Path

import numpy as np

from handpipe.core import Array
from handpipe.core.configuration import load_dataset
from handpipe.imaging.skin import VolumeSkin, skin_of_volume
from handpipe.imaging.volumes import Volume, read_volume
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.synthetic.phantom import phantom_finger

Figures = dict[str, dict[str, float | str]]

REAL = Path(__file__).parents[2] / "shared" / "data" / "real_mri"
FINGER = Path("config/datasets/phantom-finger.yaml")
SPACINGS = (0.8, 0.5)  # mm
POSE = "neutral"


def figures(real: Path = REAL) -> Figures:
    """All figures; those of the foot only where its images are."""
    found: Figures = {}
    for spacing in SPACINGS:
        found |= finger_figures(spacing)
    return found | (foot_figures(real / "foot_dixon") if (real / "foot_dixon").is_dir() else {})


def finger_figures(spacing: float) -> Figures:
    """Distances of the generated finger's skin from the true one, at a voxel size in mm."""
    volume, true = generated_finger(spacing)
    skin = skin_of_volume(volume)
    errors = Distance(true).closest(skin.open.compact().vertices)[0] / spacing
    missed = Distance(skin.closed).closest(true.vertices)[0] / spacing
    name = f"phantom_skin_{spacing:g}mm".replace(".", "_")
    found = {
        f"{name}_error_mean": _figure(errors.mean(), "voxels"),
        f"{name}_error_max": _figure(errors.max(), "voxels"),
        f"{name}_missed_mean": _figure(missed.mean(), "voxels"),
        f"{name}_closed": _figure(skin.closed.is_closed(), ""),
        f"{name}_handles": _figure(skin.handles, ""),
    }
    if spacing == SPACINGS[0]:
        found["phantom_skin_error_voxels"] = found[f"{name}_error_mean"]
    return found


def generated_finger(spacing: float) -> tuple[Volume, Surface]:
    """The generated finger's neutral image at a voxel size in mm, and its true skin."""
    dataset = load_dataset(FINGER)
    with tempfile.TemporaryDirectory() as folder:
        moved = dataset.model_copy(update={"root": Path(folder), "truth": None})
        phantom_finger.generate_pose(moved, POSE, spacing=spacing)
        volume = read_volume(moved.path(moved.poses[POSE].volume))
    posed = phantom_finger.finger().posed(phantom_finger.posture(POSE, dataset.seed))
    return volume, Surface(*posed.skin)


def foot_figures(folder: Path) -> Figures:
    """Distances between the skins of a real foot in each two of its echoes."""
    skins = [skin_of_volume(read_volume(path)) for path in sorted(folder.glob("*.nii.gz"))]
    apart = [_apart(one, other) for one, other in permutations(skins, 2)]
    return {
        "foot_skin_difference_mean": _figure(max(d.mean() for d in apart), "mm"),
        "foot_skin_difference_p95": _figure(max(np.percentile(d, 95) for d in apart), "mm"),
        "foot_skin_handles": _figure(max(s.handles for s in skins), ""),
        "foot_skin_ends": _figure(max(s.ends for s in skins), ""),
        "foot_skin_closed": _figure(all(s.closed.is_closed() for s in skins), ""),
    }


def _apart(skin: VolumeSkin, other: VolumeSkin) -> Array:
    """Distances in mm of one skin's vertices from another skin."""
    return np.asarray(Distance(other.closed).closest(skin.open.vertices)[0])


def _figure(value: float, unit: str) -> dict[str, float | str]:
    return {"value": float(value), "unit": unit}
