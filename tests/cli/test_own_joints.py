"""Bones of a person's own names: from `init --joint` to a rig that moves them as they moved."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handpipe.cli import main
from handpipe.core import RigidTransform, metrics
from handpipe.core.configuration import Dataset, load_dataset, load_scene
from handpipe.skeleton.bones import read_registrations, write_registrations
from handpipe.skeleton.motion import motion_frame_names
from handpipe.skeleton.rig import Rig

from .built import rig_of, to_the_rig
from .wrist import CENTRE, made_up

NAME = "my-wrist"
ASKED = ["init", NAME, "--volumes", "mine", "--hand", "right", "--joint", "radius-lunate"]
FIXED = ["--joint", "radius-ulna:fixed"]


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with the scans of a made-up wrist and what `init` writes for them."""
    folder = tmp_path_factory.mktemp("wrist")
    (folder / "Snakefile").touch()
    made_up().write(folder / "mine")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main([*ASKED, *FIXED]) == 0
    return folder


def test_check_accepts_what_init_writes(
    project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(project)
    assert main(["check", NAME]) == 0
    assert capsys.readouterr().out == f"{NAME}: nothing is wrong\n"
    dataset = load_dataset(f"config/datasets/{NAME}.yaml")
    assert dataset.labels == {"radius": 1, "lunate": 2, "ulna": 3} and dataset.root_bone == "radius"
    ends = {(j.parent, j.child): j.angles for j in dataset.joints.values()}
    ball = ("radius_lunate_x", "radius_lunate_y", "radius_lunate_z")
    assert ends == {("radius", "lunate"): ball, ("radius", "ulna"): ()}
    scene = load_scene(f"config/scenes/{NAME}.yaml")
    assert scene.layers == ("bones", "skin")
    frames = motion_frame_names(scene.frames, {})
    keys = [name for name in frames if "+" not in name]
    poses = ["deviated", "extended", "flexed"]  # ball joints move as the poses do, there and back
    assert [key for key in keys if "-" not in key] == ["neutral", *poses] and len(keys) == 7
    assert Path(f"config/scenes/{NAME}.csv").read_text().splitlines()[0] == "key,time [frame],pose"


@pytest.fixture(scope="module")
def built(project: Path) -> tuple[Dataset, Path]:
    """The dataset that `init` wrote, and a folder where it is built to the rig."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(project)
        dataset = load_dataset(f"config/datasets/{NAME}.yaml")
        to_the_rig(dataset, project / "built")
    return dataset, project / "built"


def test_the_rig_moves_each_bone_as_it_moved(built: tuple[Dataset, Path]) -> None:
    rig = Rig.load(built[1] / "rig.h5")
    ball, fixed = ({j.child: j for j in rig.joints}[bone] for bone in ("lunate", "ulna"))
    assert ball.fit.type == "ball" and np.linalg.norm(ball.fit.centre - CENTRE) < 0.5
    assert fixed.angles == ()
    wrist = made_up()
    for pose in wrist.poses[1:]:
        moved = rig.bone_transforms(rig.poses[pose].angles, rig.poses[pose].root)
        for bone, true in wrist.motions(pose).items():
            middle = wrist.bones[bone].centroid
            assert turn_off(moved[bone], true) < 1.0
            assert np.linalg.norm(moved[bone](middle[None]) - true(middle[None])) < 0.15
        assert turn_off(moved["lunate"], RigidTransform.identity()) > 20.0  # so that the test can fail


def test_bones_that_did_not_move_as_one_are_named(
    built: tuple[Dataset, Path], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A bone that has slid by 2 mm in one pose, although it is told to be fixed to the other."""
    dataset, folder = built
    assert not [name for name in metrics.read(folder / "rig.json") if name.startswith("apart")]
    moved = Path(shutil.copytree(folder, tmp_path / "slid")) / "flexed/moved.h5"
    found = read_registrations(moved)
    slide = RigidTransform(np.eye(3), np.array([2.0, 0.0, 0.0]))
    found["ulna"] = replace(found["ulna"], transform=found["ulna"].transform @ slide)
    write_registrations(moved, found, [])
    rig_of(dataset, tmp_path / "slid")
    assert "flexed: ulna lies" in caplog.text and "extended: " not in caplog.text
    figures = metrics.read(tmp_path / "slid/rig.json")
    assert 0.3 < figures["apart_flexed_ulna"][0] <= 1.1  # at most half of it: both bones have equal shares


def turn_off(one: RigidTransform, other: RigidTransform) -> float:
    return float(np.degrees(Rotation.from_matrix(one.rotation.T @ other.rotation).magnitude()))


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (["--joint", "radius lunate"], "radius lunate: names no two bones"),
        (["--joint", "radius-lunate", "--only", "wrist"], "--joint names other bones"),
        (["--joint", "radius-lunate", "--joint", "ulna-lunate"], "must form one tree"),
        (["--joint", "radius-radius"], "radius-radius: joins a bone to itself"),
        (
            ["--joint", "radius-lunate", "--joint", "radius-lunate:fixed"],
            "radius-lunate:fixed: is named twice",
        ),
        (["--joint", "radius-lunate", "--joint", "ulna-triquetrum"], "one tree"),
        (["--only", "radius"], "For bones of other names give --joint"),
    ],
)
def test_joints_that_are_none_are_refused(
    project: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    asked: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(project)
    assert main(["init", "other", "--volumes", "mine", "--hand", "right", *asked]) == 1
    assert said in capsys.readouterr().err
    assert not Path("config/datasets/other.yaml").exists()
    assert not Path("config/scenes/other.yaml").exists()
