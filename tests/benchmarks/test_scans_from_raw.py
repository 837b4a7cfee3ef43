"""Errors of a build in another frame, against a truth that a known turn departs from; what a person types."""

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from benchmarks.scans import from_raw
from benchmarks.scans.from_raw import FINGER, HAND, LEFT, Build, Truth, bones_off, ratios, registered_off
from scipy.spatial.transform import Rotation

from handpipe.core import RigidTransform, artifacts
from handpipe.core.configuration import load_dataset
from handpipe.develop.raw_scans import scanner_transform
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.bones import write_registrations
from handpipe.skeleton.bones.registration_result import Registration

CHECKOUT = Path(__file__).parents[2]


def motion(degrees: list[float], shift: list[float]) -> RigidTransform:
    return RigidTransform(Rotation.from_rotvec(degrees, degrees=True).as_matrix(), np.array(shift))


@dataclass(frozen=True)
class Known(Build):
    """A build whose rig is given."""

    known: object = None

    def rig(self):  # type: ignore[no-untyped-def]
        return self.known


@pytest.mark.parametrize("mirrored", [False, True])
def test_errors_do_not_depend_on_the_frame_of_the_build(tmp_path: Path, mirrored: bool) -> None:
    transform = scanner_transform(mirrored=mirrored)
    linear, shift = transform[:3, :3], transform[:3, 3]
    true = motion([10.0, -30.0, 5.0], [3.0, 40.0, -8.0])
    data = {"bones": {"distal2": {"rotation": true.rotation, "translation": true.translation}}}
    artifacts.write(tmp_path / "hook.h5", data, kind="truth", inputs=[])
    ball = trimesh.creation.icosphere(subdivisions=1, radius=4.0).apply_translation([90.0, 5.0, -3.0])
    middle = ball.vertices.mean(axis=0)
    off = RigidTransform.about(middle, motion([0.0, 2.0, 0.0], [0, 0, 0]).rotation)
    seen = motion([0, 0, 0], [0.3, 0.0, 0.4]) @ true @ off
    turned = linear @ seen.rotation @ np.linalg.inv(linear)  # x = transform(seen(transform^-1(x)))
    found = RigidTransform(turned, linear @ seen.translation + shift - turned @ shift)
    rig = SimpleNamespace(
        surfaces={"distal2": Surface(ball.vertices @ linear.T + shift, ball.faces)},
        poses={"hook": SimpleNamespace(angles={}, root=None)},
        bone_transforms=lambda angles, root: {"distal2": found},
    )
    dataset = load_dataset(CHECKOUT / "config/datasets/phantom-finger.yaml")
    own, truth = Known(tmp_path, dataset, transform, rig), Truth(dataset, tmp_path)
    registered = Registration(found, 0.1, np.eye(6))
    write_registrations(tmp_path / "registration/hook.h5", {"distal2": registered}, [])
    for off in (bones_off, registered_off):
        turns, shifts = off(own, truth, ["hook"])
        assert turns == pytest.approx([2.0]) and shifts == pytest.approx([0.5])
    doubted = {"distal2": replace(registered, doubt="it is not there")}
    write_registrations(tmp_path / "registration/hook.h5", doubted, [])
    assert registered_off(own, truth, ["hook"]) == ([], [])


def test_the_largest_ratio_is_named_for_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = {
        "plain": {"skin": (0.04, "mm"), "turn": (0.5, "deg")},
        "own": {"skin": (0.05, "mm"), "turn": (0.4, "deg")},
    }
    monkeypatch.setattr(from_raw, "errors", lambda build, truth: known[build.folder.name])
    dataset = load_dataset(CHECKOUT / "config/datasets/phantom-finger.yaml")
    found = ratios(Build(tmp_path / "plain", dataset), Build(tmp_path / "own", dataset, scanner_transform()))
    assert found["figures_ratio_max"][0] == pytest.approx(1.25)
    assert found["ratio_turn"][0] == pytest.approx(0.8) and found["raw_skin"] == (0.05, "mm")


@pytest.mark.parametrize("case", [FINGER, HAND, LEFT])
def test_a_person_types_ten_values_at_most(case: from_raw.Case) -> None:
    dataset = load_dataset(CHECKOUT / f"config/datasets/{case.plain}.yaml")
    values = [word for word in case.typed(dataset.poses_of("heldout")) if not word.startswith("--")]
    assert len(values) <= 10
