"""The command of docs/methods.md that says which pose to scan next."""

import re
import shlex
from pathlib import Path

import pytest
from five_fingers import random_angles, rig

from handpipe.skeleton.__main__ import main
from handpipe.skeleton.joints.angles import write_angles
from handpipe.skeleton.rig.next_pose import RigUncertainty

TEXT = (Path(__file__).parents[2] / "docs/methods.md").read_text(encoding="utf-8")
DOCUMENTED = shlex.split(re.search(r"^python -m handpipe.skeleton (next-pose .*)$", TEXT, re.MULTILINE)[1])
SCANNED = random_angles(1, 0.3)
LARGE, SMALL = random_angles(100, 0.95), random_angles(200, 0.2)
CANDIDATES = {"small": SMALL, "large, bent": LARGE, "scanned": SCANNED, "half": random_angles(3, 0.5)}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that the document names, in which the command runs."""
    monkeypatch.chdir(tmp_path)
    rig(poses=[SCANNED]).save("results/phantom-hand/rig.h5")
    write_angles("candidates.csv", {name.replace(",", ""): pose for name, pose in CANDIDATES.items()})
    return tmp_path


def test_the_pose_that_tells_most_comes_first(folder: Path, capsys: pytest.CaptureFixture) -> None:
    assert main(DOCUMENTED) == 0
    lines = [line.rsplit(maxsplit=2) for line in capsys.readouterr().out.splitlines()]
    printed = {name: float(error) for name, error, unit in lines if unit == "mm"}
    assert list(printed)[:2] == ["now", "large bent"] and len(printed) == 4
    known = RigUncertainty.of_rig(rig(), {"pose0": SCANNED})
    assert printed["now"] == pytest.approx(known.error, abs=6e-4)
    assert printed["large bent"] == pytest.approx(known.after(LARGE).error, abs=6e-4)
    header, first, *_ = (folder / "plan.csv").read_text(encoding="utf-8").splitlines()
    assert header == "pose,error [mm]"
    assert float(first.split(",")[1]) == pytest.approx(known.after(LARGE).error, rel=1e-9)


def test_an_angle_that_no_joint_reaches_is_named(folder: Path, capsys: pytest.CaptureFixture) -> None:
    write_angles("candidates.csv", {"broken": SMALL | {"PIP2_flexion": 9.0}})
    assert main(DOCUMENTED) == 1
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("handpipe: candidates.csv: row 2 (frame broken), PIP2_flexion: ")
    assert not (folder / "plan.csv").exists()


def test_a_number_of_poses_below_one_is_refused(folder: Path, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as caught:
        main([*DOCUMENTED, "--count", "0"])
    assert caught.value.code == 2
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("handpipe: argument --count: ")
