"""The best and the worst poses of hands, on balls whose distances from the true skin are known."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from PIL import Image

from handpipe.core import Frame, RigidTransform, Shape, artifacts
from handpipe.core.configuration import Role
from handpipe.develop import judged_poses as module
from handpipe.develop.judged_poses import judged_figure, judged_poses, main
from handpipe.hand import write_frames
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.joints.joint_tree import FittedPose
from handpipe.skeleton.rig import Rig
from handpipe.tissues.fat import Rigid, Skin

BALL = trimesh.creation.icosphere(subdivisions=4, radius=10.0)
HOME = RigidTransform(np.eye(3)[[1, 2, 0]], np.array([30.0, -5.0, 12.0]))  # scans lie in another frame
OFF = {"fist": 0.7, "half": 0.1, "hook": -0.3, "flat": 0.2, "spread": 0.5, "bow": 0.4}  # mm, by pose
CUT = np.array([0, 1])


def ball(radius: float) -> Surface:
    return Surface(BALL.vertices * (radius / 10.0), BALL.faces)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A built subject of one bone, whose skin is `OFF` outside of the true one."""
    made = tmp_path / "hand-ball"
    poses = {pose: FittedPose(HOME, {}, frozenset()) for pose in OFF}
    Rig("a", (), {"a": ball(3.0)}, poses).save(made / "rig.h5")
    Skin(ball(10.0), {"cut_end": Rigid("a", CUT)}).save(made / "skin.h5", [])
    true = Surface(HOME(ball(10.0).vertices), BALL.faces)
    (made / "data" / "scans").mkdir(parents=True)
    for pose, off in OFF.items():
        frame = Frame(pose, {}, {"a": RigidTransform.identity()})
        skin = Shape(ball(10.0).vertices, ball(10.0 + off).vertices, BALL.faces)
        write_frames(made / "poses" / pose / "skin.h5", [(frame, {"m0": {"skin": skin}})])
        trimesh.Trimesh(true.vertices, true.triangles).export(made / "data" / "scans" / f"{pose}.ply")
        truth = {"skin": {"vertices": true.vertices, "triangles": true.triangles}}
        artifacts.write(made / "data" / "truth" / f"{pose}.h5", truth, kind="truth")
    scanned = {
        pose: SimpleNamespace(
            scan=Path("scans") / f"{pose}.ply", role=Role.heldout if pose == "half" else Role.example
        )
        for pose in OFF
    }
    dataset = SimpleNamespace(
        poses={"neutral": None, **scanned},
        neutral="neutral",
        truth=SimpleNamespace(folder=Path("truth")),
        hand="right",
        has_skin=lambda pose: True,
    )
    monkeypatch.setattr(module, "load_dataset", lambda path: dataset)
    return made


def test_distances_are_those_of_the_radii_and_the_cut_end_has_none(folder: Path) -> None:
    for pose in judged_poses(folder):
        assert pose.mean == pytest.approx(
            abs(OFF[pose.frame.name]), abs=0.02
        )  # facets lie below their corners
        assert np.flatnonzero(np.isnan(pose.distances)).tolist() == CUT.tolist()


@pytest.mark.slow
def test_the_three_best_and_the_three_worst_are_drawn_in_their_order(folder: Path, tmp_path: Path) -> None:
    figure = judged_figure(judged_poses(folder))
    titles = [part.get_suptitle() for part in figure.subfigs[0].subfigs]
    assert [title.split()[1] for title in titles] == ["half", "flat", "hook", "fist", "spread", "bow"]
    assert titles[0].startswith("hand-ball, half (held out)\nmean 0.1")
    assert main([str(tmp_path / "judged.png"), str(folder)]) == 0
    assert Image.open(tmp_path / "judged.png").width > 1000


def test_a_subject_without_a_truth_is_refused(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr(module, "load_dataset", lambda path: SimpleNamespace(truth=None))
    assert main([str(tmp_path / "judged.png"), str(folder)]) == 1
    assert f"{folder}: truth: is not known. Give generated subjects" in capsys.readouterr().err
    assert not (tmp_path / "judged.png").exists()
