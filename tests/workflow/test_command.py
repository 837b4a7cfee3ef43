"""The command `handpipe`, as a person calls it in a folder of the project."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import nibabel
import numpy as np
import pytest
import SimpleITK
import trimesh

from handpipe.cli import main
from handpipe.cli.new_subject import find_poses
from handpipe.cli.own_files import LISTED
from handpipe.cli.status import RuleJobs, duration, stages
from handpipe.core import InputError, paths
from handpipe.core.configuration import load_dataset, load_scene
from handpipe.hand import named_files
from handpipe.imaging.volumes import write_segments

from .running import ENVIRONMENT, TOY, planned
from .small_subject import LABELS, write_image, write_mesh
from .test_bad_input import edit, missing_regions, open_bone

SMALL = ("small", "--stage", "segmentation", TOY)


def call(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """`handpipe ARGUMENTS` in a folder."""
    command = [sys.executable, "-m", "handpipe.cli", *arguments]
    return subprocess.run(
        command, cwd=folder, env=ENVIRONMENT, encoding="utf-8", capture_output=True, check=False
    )


@pytest.fixture
def copy(built_small: Path, tmp_path: Path) -> Path:
    """A copy of the small subject's folder, its segmentation built."""
    return Path(shutil.copytree(built_small, tmp_path / "copy", symlinks=True))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["stat"], "No such command 'stat'"),
        (["build"], "Missing argument 'SUBJECT'"),
        (["build", "small", "--cores", "0"], "--cores"),
        (["check", "small", "--fast"], "--fast"),
    ],
)
def test_a_wrong_call_ends_with_one_line_and_status_2(
    small: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(small)
    assert main(arguments) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("handpipe: ") and said in line and line.endswith("See handpipe --help")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["check", "nobody"], "config/datasets/nobody.yaml: file: does not exist"),
        (["view", "small"], "results/small/report.html: file: has not been built. Run: handpipe build small"),
        (["export", "small", "out"], "results/small: files: nothing is built yet"),
    ],
)
def test_what_is_not_there_is_named(
    small: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(small)
    assert main(arguments) == 1
    assert said in capsys.readouterr().err
    assert not (small / "out").exists()


def test_elsewhere_than_in_the_project_nothing_is_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["build", "small"]) == 1
    assert "Change to the folder of the project first" in capsys.readouterr().err


def write_scans(folder: Path) -> None:
    """Names of files as people give them; nothing in the files but what tells DICOM."""
    for name in (
        "neutral.nii.gz",
        "neutral-seeds.nii.gz",
        "Fist 2.nrrd",
        "scans/Fist 2 skin.stl",
        "notes.txt",
    ):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    (folder / "hook mri").mkdir()
    for i in range(2):
        (folder / "hook mri" / f"IM{i}").write_bytes(bytes(128) + b"DICM")


def test_init_finds_the_poses_of_a_folder(tmp_path: Path) -> None:
    write_scans(tmp_path)
    assert find_poses(tmp_path) == {
        "neutral": {"volume": Path("neutral.nii.gz"), "seeds": Path("neutral-seeds.nii.gz")},
        "Fist_2": {"volume": Path("Fist 2.nrrd"), "scan": Path("scans/Fist 2 skin.stl")},
        "hook": {"volume": Path("hook mri")},
    }
    table = {"proximal2": 1, "background": 255}
    write_segments(tmp_path / "hook.seg.nrrd", np.zeros((4, 4, 4), np.uint8), np.eye(4), table)
    write_segments(tmp_path / "Fist 2.seg.nrrd", np.zeros((4, 4, 4), np.uint8), np.eye(4), {"proximal2": 1})
    found = find_poses(tmp_path)
    assert found["hook"]["seeds"] == Path("hook.seg.nrrd")
    assert found["Fist_2"]["labels"] == Path("Fist 2.seg.nrrd")
    (tmp_path / "hook.mha").touch()
    with pytest.raises(InputError, match="are both the volume of hook"):
        find_poses(tmp_path)


@pytest.mark.parametrize("side", ["right", "left"])
def test_init_writes_a_dataset_that_loads(
    small: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], side: str
) -> None:
    monkeypatch.chdir(small)
    write_scans(small / "mine")
    (small / "mine/neutral-seeds.nii.gz").unlink()
    asked = ["init", "my-hand", "--volumes", "mine", "--hand", side, "--heldout", "hook"]
    assert main(asked) == 0
    said = capsys.readouterr().out
    assert "save them as mine/neutral-seeds.seg.nrrd" in said
    assert "no skin scan: hook, neutral" in said
    dataset = load_dataset("config/datasets/my-hand.yaml")
    assert dataset.hand == side and dataset.drawn_in == "template"
    assert {name: pose.role for name, pose in dataset.poses.items()} == {
        "neutral": "neutral",
        "Fist_2": "example",
        "hook": "heldout",
    }
    scene = load_scene("config/scenes/my-hand.yaml")
    assert dataset.skin_from_volume and "fat" in scene.layers  # neutral has no scan
    missing = [field for field, path in named_files(dataset).items() if not path.exists()]
    assert missing == ["poses.neutral.seeds"]
    before = (small / "config/datasets/my-hand.yaml").read_bytes()
    assert main(asked) == 1  # nothing is overwritten
    assert "exists already" in capsys.readouterr().err
    assert (small / "config/datasets/my-hand.yaml").read_bytes() == before


def test_init_of_one_finger_bends_its_joints(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(small)
    write_scans(small / "mine")
    (small / "mine/neutral.ply").touch()
    assert main(["init", "one", "--volumes", "mine", "--hand", "right", "--only", "index"]) == 0
    dataset = load_dataset("config/datasets/one.yaml")
    assert [*dataset.bones] == ["metacarpal2", "proximal2", "middle2", "distal2"]
    assert load_scene("config/scenes/one.yaml").layers[-2:] == ("fat", "skin")
    header, *_, last = (small / "config/scenes/one.csv").read_text().splitlines()
    assert header == "frame,MP2_flexion [deg],PIP2_flexion [deg],DIP2_flexion [deg]"
    assert last == "bent2,19.0,22.0,16.0"  # a fifth of 95, 110 and 80


def test_init_names_files_that_it_does_not_use(
    small: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(small)
    write_scans(small / "mine")
    (small / "mine/fists.ply").touch()
    (small / "mine/Fäuste.nii").touch()
    assert main(["init", "my-hand", "--volumes", "mine", "--hand", "right"]) == 0
    assert "not used: fists.ply, since no volume has its name" in capsys.readouterr().out
    assert "F_uste" in load_dataset("config/datasets/my-hand.yaml").poses


def test_init_of_a_name_that_is_none_writes_nothing(
    small: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(small)
    write_scans(small / "mine")
    assert main(["init", "My Hand", "--volumes", "mine", "--hand", "right"]) == 1
    assert "config/datasets/My Hand.yaml: name" in capsys.readouterr().err
    assert not (small / "config/datasets/My Hand.yaml").exists() and not (small / "mine/template").exists()


def test_init_writes_a_frame_of_their_own_for_scans_that_lie_elsewhere(
    small: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One scan is displaced by 20 mm and 15 deg; one scanner has taken both."""
    monkeypatch.chdir(small)
    (small / "mine").mkdir()
    limb = trimesh.creation.capsule(height=50, radius=10)
    limb.vertices *= [1.0, 0.7, 1.0]
    limb.vertices[:, 0] += 0.01 * (limb.vertices[:, 2] - 25.0) ** 2  # bent, so that every turn shows
    index = np.moveaxis(np.indices((50, 40, 90)), 0, -1) - [22.0, 20.0, 20.0]
    inside = limb.contains(index.reshape(-1, 3)).reshape(index.shape[:-1])
    affine = np.eye(4)
    affine[:3, 3] = [-22.0, -20.0, -20.0]
    turned = trimesh.transformations.rotation_matrix(np.radians(15.0), [0.6, 0.0, 0.8], [0.0, 0.0, 25.0])
    turned[:3, 3] += [12.0, 16.0, 0.0]
    for pose, moved in (("neutral", turned), ("fist", np.eye(4))):
        write_image(small / f"mine/{pose}.nii.gz", np.where(inside, 300.0, 5.0).astype(np.float32), affine)
        write_mesh(small / f"mine/{pose}.stl", limb.copy().apply_transform(moved))
    assert main(["init", "mine", "--volumes", "mine", "--hand", "right", "--only", "index"]) == 0
    assert "scan_frame: own is written for neutral: the scan fits its volume once turned by 15 deg" in (
        capsys.readouterr().out
    )
    poses = load_dataset("config/datasets/mine.yaml").poses
    assert {name: pose.scan_frame for name, pose in poses.items()} == {"neutral": "own", "fist": "own"}
    lines = Path("config/datasets/mine.yaml").read_text().splitlines()
    for pose, reason in (("neutral", "turned by 15 deg and moved by 2"), ("fist", "as the other scans")):
        before = lines[next(i for i, line in enumerate(lines) if line.startswith(f"  {pose}: ")) - 1]
        assert before.startswith("  # ") and reason in before


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--volumes", "nowhere"], "nowhere: folder: does not exist"),
        (["--volumes", "config"], "holds no volume"),
        (["--volumes", "mine", "--neutral", "flat"], "has no pose flat"),
        (["--volumes", "mine", "--heldout", "bow"], "has no pose bow"),
    ],
)
def test_init_names_what_it_lacks(
    small: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(small)
    write_scans(small / "mine")
    assert main(["init", "my-hand", "--hand", "right", *arguments]) == 1
    assert said in capsys.readouterr().err
    assert not (small / "config/datasets/my-hand.yaml").exists() and not (small / "mine/template").exists()


def test_check_names_each_fault_in_a_line(
    small: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(small)
    assert main(["check", "small"]) == 0
    assert capsys.readouterr().out == "small: nothing is wrong\n"
    open_bone(small)
    missing_regions(small)
    assert main(["check", "small"]) == 1
    said = capsys.readouterr()
    assert said.out == "small: 2 faults\n"
    lines = sorted(said.err.splitlines())
    assert lines[0].startswith(
        "handpipe: config/datasets/small.yaml: regions.bone_fascia: small/painted.json"
    )
    assert lines[1].startswith("handpipe: small/far.ply: triangles: is open")


def test_check_names_each_wrong_field_of_the_dataset_file(
    small: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(small)
    edit(small, lambda d: d.update(hand="both", units="cm"))
    edit(small, lambda d: d["bones"]["far"].update(label=300))
    assert main(["check", "small"]) == 1
    said = capsys.readouterr()
    assert said.out == "small: 3 faults\n"
    fields = {line.split(": ")[2] for line in said.err.splitlines()}
    assert fields == {"hand", "units", "bones.far.label"}


def test_status_counts_jobs_as_the_workflow_does(copy: Path) -> None:
    built = call(copy, "status", *SMALL)
    assert built.returncode == 0, built.stderr
    done, jobs = map(int, re.findall(r"small: (\d+) of (\d+) jobs are done", built.stdout)[0])
    assert done == jobs > 0
    logs = [p.read_text(encoding="utf-8") for p in (copy / "results/small/logs").rglob("*.log")]
    count = sum(" WARNING " in line for log in logs for line in log.splitlines())
    assert (f"warnings: {count} (handpipe warnings small)" in built.stdout) == (count > 0)
    listed = call(copy, "warnings", "small").stdout.splitlines()
    assert sum(line.startswith("  ") for line in listed) == count
    seeds = nibabel.load(copy / "small/bent-seeds.nii.gz")
    write_image(copy / "small/bent-seeds.nii.gz", np.asarray(seeds.dataobj)[::-1], seeds.affine)
    left = planned(copy, "segmentation", "--config", "subjects=[small]")
    left.pop("segmentation", None)
    assert left
    said = call(copy, "status", *SMALL).stdout
    assert f"small: {jobs - sum(left.values())} of {jobs} jobs are done" in said
    for rule, count in left.items():
        assert re.search(rf"^{rule} +\d+ +{count}  [\d.]+$", said, re.MULTILINE)
    assert "time left on 2 cores: about" in said and "unknown" not in said


def test_a_build_goes_on_and_ends(copy: Path) -> None:
    target = copy / paths.at(paths.metrics_of("segmentation"), subject="small")
    target.unlink()
    process = call(copy, "build", *SMALL)
    assert process.returncode == 0, process.stdout + process.stderr
    assert target.is_file()
    open_bone(copy)
    assert call(copy, "build", *SMALL).returncode == 1


def test_exported_labels_have_names_places_and_values(copy: Path) -> None:
    process = call(copy, "export", "small", "out")
    assert process.returncode == 0, process.stderr
    written = [Path(line).name for line in process.stdout.splitlines()]
    assert sorted([*written, LISTED]) == sorted(p.name for p in (copy / "out").iterdir())
    own = nibabel.load(copy / paths.at(paths.LABELS, subject="small", pose="bent"))
    image = SimpleITK.ReadImage(str(copy / "out/small-bent.seg.nrrd"))
    np.testing.assert_array_equal(SimpleITK.GetArrayFromImage(image).T, np.asarray(own.dataobj))
    x = image.TransformContinuousIndexToPhysicalPoint((3.0, 5.0, 7.0))
    np.testing.assert_allclose(np.array(x) * [-1, -1, 1], (own.affine @ [3.0, 5.0, 7.0, 1.0])[:3])
    segments = {
        image.GetMetaData(key): int(image.GetMetaData(key.replace("_Name", "_LabelValue")))
        for key in image.GetMetaDataKeys()
        if re.fullmatch(r"Segment\d+_Name", key)
    }
    assert segments == LABELS
    description = (copy / "out/small-labels.txt").read_text(encoding="utf-8")
    rows = re.findall(r'^ +(\d+) +(\d+) +(\d+) +(\d+) +1  1  1    "(\w+)"$', description, re.MULTILINE)
    assert {name: int(label) for label, *_, name in rows} == LABELS
    assert len({tuple(colour) for _, *colour, _ in rows}) == len(LABELS)


def test_time_left_is_that_of_earlier_jobs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for subject, seconds in (("mine", 10.0), ("other", 99.0)):
        folder = tmp_path / paths.at(paths.COSTS, subject=subject)
        for rule in ("slow", "quick"):
            (folder / rule).mkdir(parents=True)
        (folder / "slow/a.tsv").write_text(f"s\tcpu_time\n{seconds}\t1\n{seconds + 2}\t1\n", encoding="utf-8")
    (tmp_path / paths.at(paths.COSTS, subject="other") / "quick/a.tsv").write_text(
        "s\n4.0\n", encoding="utf-8"
    )
    found = stages({"slow": 2, "quick": 1}, {"slow": 5, "quick": 1, "new": 3}, "mine")
    assert found == [RuleJobs("slow", 3, 2, 11.0), RuleJobs("quick", 0, 1, 4.0), RuleJobs("new", 3, 0, None)]
    assert sum(stage.seconds_left for stage in found) == 26.0


def test_durations_are_as_exact_as_estimates() -> None:
    assert [duration(s) for s in (12.3, 100.0, 5400.0, 9000.0)] == ["12 s", "2 min", "1.5 h", "2.5 h"]
