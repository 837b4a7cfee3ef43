"""A wrist alone: the template's bones with another root, and bones of a person's own names in a ball joint.

Both are generated: the phantom hand's carpals and metacarpals in two poses, strokes in neutral alone.
"""

import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from handpipe.cli import main
from handpipe.core import RigidTransform, artifacts
from handpipe.core.configuration import Scanner, load_dataset
from handpipe.imaging.volumes import read_labels, read_volume, write_segments
from handpipe.skeleton.rig import Rig
from handpipe.synthetic.acquisition import draw
from handpipe.synthetic.phantom import phantom_hand

from .running import CHECKOUT, run, working_copy

POSES = ("neutral", "oppose_little")
PALM = {"hamate": "carpus", "metacarpal4": "ring_base", "metacarpal5": "little_base"}  # and a person's names
OWN_JOINTS = ("carpus-ring_base", "carpus-little_base")
SUBJECTS = ("my-palm", "my-carpus")
WITHIN = 2.0  # deg, of a bone's turn against the one that carries it: rolls of short bones show least


def generate(folder: Path) -> None:
    """Volumes of all poses and their truth; a label volume of strokes in neutral."""
    whole = load_dataset(CHECKOUT / "config/datasets/phantom-hand.yaml")
    dataset = whole.model_copy(
        update={
            "root": folder,
            "bones": {bone: whole.bones[bone] for bone in PALM},
            "scanner": Scanner(spacing=0.5),
        }
    )
    for pose in POSES:
        phantom_hand.generate_pose(dataset, pose)
    draw(dataset, "neutral")


def arrange(generated: Path, folder: Path) -> None:
    """Files as people have them: volumes, and the strokes as labels or as segments of other names."""
    for subject in SUBJECTS:
        (folder / subject).mkdir()
        for pose in POSES:
            shutil.copy(generated / f"volumes/{pose}.nii.gz", folder / subject)
    shutil.copy(generated / "seeds/neutral.nii.gz", folder / "my-palm/neutral-seeds.nii.gz")
    given = load_dataset(CHECKOUT / "config/datasets/phantom-hand.yaml").labels
    volume = read_volume(generated / "volumes/neutral.nii.gz")
    drawn = read_labels(generated / "seeds/neutral.nii.gz", volume, {bone: given[bone] for bone in PALM})
    table = {own: given[bone] for bone, own in PALM.items()} | {"background": 255}
    write_segments(folder / "my-carpus/neutral-seeds.seg.nrrd", drawn, volume.affine, table)


def scribble(path: Path, bone: str) -> None:
    """Name the strokes as scribbles of a bone: a person has looked at it. The capitate beside it has none."""
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    neutral = content["poses"]["neutral"]
    neutral["scribbles"] = {bone: neutral["seeds"]}
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A working copy where the rigs of both subjects are built from what `init` wrote."""
    folder = working_copy(tmp_path_factory.mktemp("wrist") / "copy")
    generate(folder / "made")
    arrange(folder / "made", folder)
    only = [word for bone in PALM for word in ("--only", bone)]
    joints = [word for joint in OWN_JOINTS for word in ("--joint", joint)]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for subject, asked in zip(SUBJECTS, (only, joints), strict=True):
            assert main(["init", subject, "--volumes", subject, "--hand", "right", *asked]) == 0
            root = PALM["hamate"] if subject == "my-carpus" else "hamate"
            scribble(Path(f"config/datasets/{subject}.yaml"), root)
            assert main(["check", subject]) == 0
    process = run(folder, "-j1", "rig", "--config", f"subjects=[{','.join(SUBJECTS)}]", "scenes=[my-palm]")
    assert process.returncode == 0, process.stdout
    return folder


def true_motion(folder: Path, pose: str, bone: str) -> RigidTransform:
    data = artifacts.read(folder / f"made/truth/{pose}.h5", "truth")["bones"][bone]
    return RigidTransform(data["rotation"], data["translation"])


def turn_off(a: RigidTransform, b: RigidTransform) -> float:
    return float(np.degrees(Rotation.from_matrix(a.rotation.T @ b.rotation).magnitude()))


@pytest.mark.parametrize("subject", SUBJECTS)
def test_the_rig_moves_each_bone_as_it_moved(built: Path, subject: str) -> None:
    own = PALM if subject == "my-carpus" else {bone: bone for bone in PALM}
    rig = Rig.load(built / f"results/{subject}/rig.h5")
    assert rig.root == own["hamate"]
    for pose in POSES[1:]:
        moved = rig.bone_transforms(rig.poses[pose].angles)
        base = true_motion(built, pose, "hamate").inverse()
        for bone in ("metacarpal4", "metacarpal5"):
            true = base @ true_motion(built, pose, bone)
            assert turn_off(moved[own[bone]], true) < WITHIN
            middle = rig.surfaces[own[bone]].centroid()
            assert np.linalg.norm(moved[own[bone]](middle) - true(middle)) < 0.5
            still = turn_off(RigidTransform.identity(), true)
            assert still > 2.0 * WITHIN  # so that the test can fail


def test_a_ball_joint_has_three_angles_and_bends_in_the_first_scene(built: Path) -> None:
    dataset = load_dataset(built / "config/datasets/my-carpus.yaml")
    assert {(j.parent, j.child, len(j.angles)) for j in dataset.joints.values()} == {
        ("carpus", "ring_base", 3),
        ("carpus", "little_base", 3),
    }
    header, _, _, last = (built / "config/scenes/my-carpus.csv").read_text().splitlines()
    assert header == "frame,carpus_ring_base_x [deg],carpus_little_base_x [deg]" and last == "bent2,9.0,9.0"


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (["--joint", "radius lunate"], "radius lunate: names no two bones"),
        (["--joint", "radius-lunate", "--only", "wrist"], "--joint names other bones"),
        (["--joint", "radius-lunate", "--joint", "ulna-lunate"], "must form one tree"),
        (["--only", "radius"], "For bones of other names give --joint"),
    ],
)
def test_joints_that_are_none_are_refused(
    built: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    asked: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(built)
    assert main(["init", "other", "--volumes", "my-carpus", "--hand", "right", *asked]) == 1
    assert said in capsys.readouterr().err
    assert not Path("config/datasets/other.yaml").exists()
