"""A wrist alone: the template's bones with another root, and bones of a person's own names in a ball joint.

Both are generated: the phantom hand's carpals and metacarpals in two poses, strokes in neutral alone.
"""

from pathlib import Path

import nibabel
import numpy as np
import pytest
from scipy.ndimage import binary_erosion
from scipy.spatial.transform import Rotation

from handpipe.cli import main
from handpipe.core import RigidTransform, artifacts
from handpipe.core.configuration import Scanner, load_dataset
from handpipe.imaging.volumes import rasterise, read_labels, read_volume, write_segments
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.rig import Rig
from handpipe.synthetic.acquisition import draw
from handpipe.synthetic.phantom import phantom_hand

from .running import CHECKOUT, run, working_copy

POSES = ("neutral", "oppose_little")
PALM = ("hamate", "metacarpal4", "metacarpal5")
THUMB = {"trapezium": "carpus", "metacarpal1": "thumb_base"}  # names in the phantom and to the person
SUBJECTS = {"my-palm": (PALM, "hamate"), "my-thumb": (tuple(THUMB), "trapezium")}
WITHIN = 2.0  # deg, of a bone's turn against the one that carries it: rolls of short bones show least


def generate(folder: Path, bones: tuple[str, ...]) -> None:
    """Volumes of all poses and their truth; a label volume of strokes in neutral."""
    whole = load_dataset(CHECKOUT / "config/datasets/phantom-hand.yaml")
    dataset = whole.model_copy(
        update={
            "root": folder,
            "bones": {bone: whole.bones[bone] for bone in bones},
            "scanner": Scanner(spacing=0.5),
            "truth": whole.truth,
        }
    )
    for pose in POSES:
        phantom_hand.generate_pose(dataset, pose)
    draw(dataset, "neutral")
    _strike_out_others(folder, bones)


def _strike_out_others(folder: Path, bones: tuple[str, ...]) -> None:
    """Background in the marrow of each bone that is in the image and not among those that are modelled."""
    volume = read_volume(folder / "volumes/neutral.nii.gz")
    seeds = nibabel.load(folder / "seeds/neutral.nii.gz")
    others = {
        i: Surface(*m) for i, (n, m) in enumerate(phantom_hand.hand().marrow.items(), 1) if n not in bones
    }
    inside = binary_erosion(rasterise(volume, others) > 0)
    drawn = np.where(inside, 255, np.asarray(seeds.dataobj)).astype(np.uint8)
    nibabel.save(nibabel.Nifti1Image(drawn, seeds.affine), folder / "seeds/neutral.nii.gz")


def arrange(generated: Path, scans: Path, names: dict[str, str] | None) -> None:
    """Files as a person has them: volumes, and the strokes as labels or as segments of other names."""
    scans.mkdir()
    for pose in POSES:
        (generated / f"volumes/{pose}.nii.gz").rename(scans / f"{pose}.nii.gz")
    if names is None:
        (generated / "seeds/neutral.nii.gz").rename(scans / "neutral-seeds.nii.gz")
        return
    given = load_dataset(CHECKOUT / "config/datasets/phantom-hand.yaml").labels
    volume = read_volume(scans / "neutral.nii.gz")
    drawn = read_labels(generated / "seeds/neutral.nii.gz", volume, {bone: given[bone] for bone in names})
    table = {own: given[bone] for bone, own in names.items()} | {"background": 255}
    write_segments(scans / "neutral-seeds.seg.nrrd", drawn, volume.affine, table)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A working copy where the rigs of both subjects are built from what `init` wrote."""
    folder = working_copy(tmp_path_factory.mktemp("wrist") / "copy")
    for subject, (bones, _) in SUBJECTS.items():
        generate(folder / f"made-{subject}", bones)
        arrange(folder / f"made-{subject}", folder / subject, THUMB if subject == "my-thumb" else None)
    only = [argument for bone in PALM for argument in ("--only", bone)]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for subject, asked in (("my-palm", only), ("my-thumb", ["--joint", "carpus-thumb_base"])):
            assert main(["init", subject, "--volumes", subject, "--hand", "right", *asked]) == 0
            assert main(["check", subject]) == 0
    process = run(folder, "-j1", "rig", "--config", f"subjects=[{','.join(SUBJECTS)}]", "scenes=[my-palm]")
    assert process.returncode == 0, process.stdout
    return folder


def true_motion(folder: Path, subject: str, pose: str, bone: str) -> RigidTransform:
    data = artifacts.read(folder / f"made-{subject}/truth/{pose}.h5", "truth")["bones"][bone]
    return RigidTransform(data["rotation"], data["translation"])


def turn_off(a: RigidTransform, b: RigidTransform) -> float:
    return float(np.degrees(Rotation.from_matrix(a.rotation.T @ b.rotation).magnitude()))


@pytest.mark.parametrize("subject", SUBJECTS)
def test_the_rig_moves_each_bone_as_it_moved(built: Path, subject: str) -> None:
    bones, root = SUBJECTS[subject]
    own = {bone: THUMB.get(bone, bone) if subject == "my-thumb" else bone for bone in bones}
    rig = Rig.load(built / f"results/{subject}/rig.h5")
    assert rig.root == own[root]
    for pose in POSES[1:]:
        moved = rig.bone_transforms(rig.poses[pose].angles)
        base = true_motion(built, subject, pose, root).inverse()
        for bone in bones[1:]:
            true = base @ true_motion(built, subject, pose, bone)
            assert turn_off(moved[own[bone]], true) < WITHIN
            middle = rig.surfaces[own[bone]].centroid()
            assert np.linalg.norm(moved[own[bone]](middle) - true(middle)) < 0.7


def test_a_ball_joint_has_three_angles_and_bends_in_the_first_scene(built: Path) -> None:
    dataset = load_dataset(built / "config/datasets/my-thumb.yaml")
    [joint] = dataset.joints.values()
    assert (joint.parent, joint.child, len(joint.angles)) == ("carpus", "thumb_base", 3)
    header, _, _, last = (built / "config/scenes/my-thumb.csv").read_text().splitlines()
    assert header == "frame,carpus_thumb_base_x [deg]" and last == "bent2,9.0"


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
    assert main(["init", "other", "--volumes", "my-thumb", "--hand", "right", *asked]) == 1
    assert said in capsys.readouterr().err
    assert not Path("config/datasets/other.yaml").exists()
