"""The phantom hand's truth and files, checked with other libraries than those that made them."""

import json
from pathlib import Path

import igl
import nibabel
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from handpipe.core import artifacts
from handpipe.core.configuration.anatomy import Bone
from handpipe.core.configuration.dataset import Dataset, load_dataset
from handpipe.core.configuration.images import Scanner
from handpipe.core.configuration.pose import Pose, Role
from handpipe.core.configuration.scene import load_scene
from handpipe.core.errors import InputError
from handpipe.hand.subject import joint_limits
from handpipe.skeleton.joints.angles import read_angles
from handpipe.synthetic import generators
from handpipe.synthetic.acquisition import image, seeds
from handpipe.synthetic.phantom import phantom_hand, posed_hand
from handpipe.synthetic.phantom.phantom_hand_bones import RAYS, ROOT, WITH_ROOT
from handpipe.synthetic.phantom.phantom_hand_joints import POSES, joints

CONFIG = Path(__file__).parents[2] / "config/datasets"
NAMES = ("phantom-hand", "phantom-hand-seeded", "phantom-hand-left")


@pytest.fixture(scope="module")
def hands() -> dict[str, posed_hand.PosedHand]:
    return {pose: phantom_hand.hand().posed(phantom_hand.posture(pose, 1)) for pose in POSES}


def coarse(name: str, root: Path) -> Dataset:
    return load_dataset(CONFIG / f"{name}.yaml").model_copy(
        update={"root": root, "scanner": Scanner(spacing=1.2)}
    )


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Dataset:
    found = coarse("phantom-hand-seeded", tmp_path_factory.mktemp("hand"))
    for pose in ("neutral", "fist"):
        generators.generator_of(found).generate_pose(found, pose)
        seeds.draw(found, pose)
    return found


def volume_of(dataset: Dataset, path: Path):
    return np.asarray(nibabel.load(dataset.path(path)).dataobj)


def mesh(surface) -> trimesh.Trimesh:
    return trimesh.Trimesh(*surface, process=False)


@pytest.mark.parametrize("name", NAMES)
def test_joints_are_those_of_the_papers_hierarchy(name):
    data = load_dataset(CONFIG / f"{name}.yaml")
    freedoms = [len(j.angles) for j in data.joints.values() if j.angles]
    assert len(data.bones) == 23 and len(freedoms) == 17 and sum(freedoms) == 23
    assert freedoms.count(1) == 11 and freedoms.count(2) == 6
    still = {j.child for j in data.joints.values() if not j.angles}
    assert still == set(WITH_ROOT) and data.root_bone == ROOT
    assert set(data.poses) == set(POSES) and len(data.examples) == 6 and len(data.poses) == 12


@pytest.mark.parametrize("name", NAMES)
def test_dataset_files_say_what_the_truth_is(name):
    data = load_dataset(CONFIG / f"{name}.yaml")
    known = {j.name: j for j in joints()}
    if data.hand == "left":
        known = {n: posed_hand.mirrored_joint(j) for n, j in known.items()}
    moving = {n: j for n, j in data.joints.items() if j.angles}
    assert set(moving) == set(known)
    for joint_name, joint in moving.items():
        true = known[joint_name]
        assert (joint.parent, joint.child, joint.angles) == (true.parent, true.child, true.angles)
        for hint, axis in zip(joint.axis_hints, true.axes, strict=True):
            assert hint @ axis > 0.95 * np.linalg.norm(hint)
        for angle, (lower, upper) in zip(joint.angles, joint.limits_deg, strict=True):
            assert all(lower <= angles[angle] <= upper for angles in POSES.values())


def test_the_scene_of_all_poses_fits_the_hand():
    data = load_dataset(CONFIG / "phantom-hand.yaml")
    frames = read_angles(load_scene(CONFIG.parent / "scenes/hand-poses.yaml").frames, joint_limits(data))
    assert list(frames) == list(POSES)
    for pose, angles in frames.items():
        assert angles == pytest.approx({name: np.radians(value) for name, value in POSES[pose].items()})


def test_lengths_are_those_of_the_measurements(hands):
    """Western male, median: Buryanov and Kotiuk 2010, as the reference measurements compile them."""
    lengths = {
        1: (49, 32, 22),
        2: (66, 40, 22, 16),
        3: (69, 44, 24, 17),
        4: (65, 41, 22, 16),
        5: (57, 31, 18, 14),
    }
    for ray, expected in lengths.items():
        for kind, length in zip(RAYS[ray], expected, strict=True):
            points = hands["neutral"].bones[f"{kind}{ray}"][0]
            axis = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][0]
            assert np.ptp(points @ axis) == pytest.approx(length, rel=0.1)


def test_surfaces_are_closed_and_marrow_is_inside(hands):
    hand = hands["neutral"]
    for name, surface in hand.bones.items():
        for part in (surface, hand.marrow[name]):
            assert mesh(part).is_watertight and mesh(part).euler_number == 2 and mesh(part).volume > 0
        depth = -igl.signed_distance(hand.marrow[name][0], *surface)[0]
        assert depth.min() > 0.35 and np.median(depth) < 1.6, name


@pytest.mark.parametrize("pose", POSES)
def test_bones_do_not_overlap_and_joints_stay_close(hands, pose):
    hand = hands[pose]
    near = 1e9 * np.ones(len(hand.joints))
    for name, (points, triangles) in hand.bones.items():
        low, high = points.min(axis=0) - 2.0, points.max(axis=0) + 2.0
        for other, (vertices, _) in hand.bones.items():
            some = vertices[((vertices > low) & (vertices < high)).all(axis=1)]
            if other == name or len(some) == 0:
                continue
            gap = igl.signed_distance(some, points, triangles)[0].min()
            assert gap > 0.05, (other, name)
            for i, joint in enumerate(hand.joints):
                if {joint.parent, joint.child} == {name, other}:
                    near[i] = min(near[i], gap)
    assert near.max() < 1.6


def test_united_bones_move_as_one_and_no_fixed_axis_explains_a_joint(hands):
    for hand in hands.values():
        for name in WITH_ROOT:
            assert hand.transforms[name].angle_to(hand.transforms[ROOT]) < 1e-9
    for joint in joints():
        if len(joint.angles) != 1:
            continue
        axes = []
        for hand in hands.values():
            relative = hand.transforms[joint.parent].inverse() @ hand.transforms[joint.child]
            if np.linalg.norm(turn := relative.rotation_vector()) > np.radians(8):
                axes.append(turn / np.linalg.norm(turn) * np.sign(turn @ joint.axes[0]))
        if len(axes) > 3:
            assert np.degrees(np.arccos(np.clip(np.array(axes) @ joint.axes[0], -1, 1)).max()) > 0.5


@pytest.mark.parametrize("ray", [2, 3, 4, 5])
def test_thumb_reaches_each_finger(hands, ray):
    """In its opposition, thumb and fingertip are two pads' soft tissue apart, and nowhere else so near."""
    pose = f"oppose_{ {2: 'index', 3: 'middle', 4: 'ring', 5: 'little'}[ray] }"

    def distance(hand):
        return igl.signed_distance(hand.bones["distal1"][0], *hand.bones[f"distal{ray}"])[0].min()

    gaps = {name: distance(hand) for name, hand in hands.items()}
    assert min(gaps, key=gaps.get) == pose and 2.0 < gaps[pose] < 11.0


def test_left_hand_is_the_mirror_image(hands):
    """Mirrored axes with the same angles move the mirrored bones, and every frame stays right-handed."""
    for pose in ("spread", "oppose_ring"):
        right, left = hands[pose], hands[pose].mirrored()
        neutral = hands["neutral"].mirrored()
        for name, (points, triangles) in left.bones.items():
            np.testing.assert_allclose(points, right.bones[name][0] * [1, -1, 1])
            assert mesh((points, triangles)).volume > 0
            moved = left.transforms[name](neutral.bones[name][0])
            np.testing.assert_allclose(moved, points, atol=1e-9)
            assert np.linalg.det(left.transforms[name].rotation) == pytest.approx(1.0)
        for joint in left.joints:
            parent = left.transforms[joint.parent]
            own = joint.transform(left.angles)
            found = (parent @ own).rotation.T @ left.transforms[joint.child].rotation
            assert Rotation.from_matrix(found).magnitude() < 1e-9


def test_labels_fill_the_volumes_of_the_surfaces(dataset):
    for pose in ("neutral", "fist"):
        truth = artifacts.read(dataset.path(Path("truth")) / f"{pose}.h5", "truth")
        labels = volume_of(dataset, Path(f"truth/{pose}.bones.nii.gz"))
        for name, bone in dataset.bones.items():
            true = mesh((truth["bones"][name]["vertices"], truth["bones"][name]["triangles"])).volume
            assert (labels == bone.label).sum() * 1.2**3 == pytest.approx(true, rel=0.1), name


def test_image_shows_bright_marrow_in_dark_bone(dataset):
    values = volume_of(dataset, dataset.poses["fist"].volume)
    marrow = volume_of(dataset, Path("truth/fist.marrow.nii.gz"))
    whole = volume_of(dataset, Path("truth/fist.bones.nii.gz"))
    shell = (whole > 0) & (marrow == 0)
    assert np.median(values[shell]) < 0.6 * np.median(values[marrow > 0])
    assert values.dtype == np.float32 and np.isfinite(values).all()


def test_seeds_lie_in_their_bones(dataset):
    for pose in ("neutral", "fist"):
        drawn = volume_of(dataset, dataset.poses[pose].seeds)
        marrow = volume_of(dataset, Path(f"truth/{pose}.marrow.nii.gz"))
        whole = volume_of(dataset, Path(f"truth/{pose}.bones.nii.gz"))
        own = (drawn > 0) & (drawn < seeds.BACKGROUND)
        assert set(np.unique(drawn)) == {0, 255, *(b.label for b in dataset.bones.values())}
        np.testing.assert_array_equal(drawn[own], marrow[own])
        assert not whole[drawn == seeds.BACKGROUND].any()


def test_a_dataset_of_a_few_bones_is_imaged_around_them(tmp_path):
    few = {name: Bone(label=label) for label, name in enumerate(("proximal2", "middle2", "distal2"), 1)}
    data = coarse("phantom-hand-seeded", tmp_path).model_copy(update={"bones": few})
    generators.generator_of(data).generate_pose(data, "hook")
    seeds.draw(data, "hook")
    labels = volume_of(data, Path("truth/hook.bones.nii.gz"))
    assert set(np.unique(labels)) == {0, 1, 2, 3}
    assert set(np.unique(volume_of(data, data.poses["hook"].seeds))) == {0, 1, 2, 3, 255}
    truth = artifacts.read(tmp_path / "truth/hook.h5", "truth")["bones"]
    points = np.concatenate([truth[name]["vertices"] for name in few])
    assert (np.array(labels.shape) * 1.2 < np.ptp(points, axis=0) + 2 * posed_hand.MARGIN + 3.0).all()


def test_the_same_seed_gives_the_same_files(dataset, tmp_path):
    again = dataset.model_copy(update={"root": tmp_path})
    generators.generator_of(again).generate_pose(again, "fist")
    seeds.draw(again, "fist")
    for path in (dataset.poses["fist"].volume, dataset.poses["fist"].seeds):
        np.testing.assert_array_equal(volume_of(dataset, path), volume_of(again, path))


def test_local_painting_is_painting(hands):
    """Boxes around the surfaces change nothing but the time."""
    hand = hands["fist"]
    grid = image.VoxelGrid.around(hand.bones["distal1"][0], 4.0, 0.8)
    surfaces = {1: hand.bones["distal1"], 2: hand.bones["proximal1"]}
    labels = image.label_volume(surfaces, grid)
    whole = {value: image.occupancy(surface, grid) for value, surface in surfaces.items()}
    np.testing.assert_array_equal(labels, seeds.majority(whole))


def test_what_the_phantom_lacks_is_refused(tmp_path):
    data = coarse("phantom-hand", tmp_path)
    with pytest.raises(InputError, match="seeds"):
        seeds.draw(data, "fist")
    scanned = Pose(role=Role.neutral, volume=Path("v.nii.gz"), seeds=Path("s.nii.gz"), scan=Path("s.ply"))
    with pytest.raises(InputError, match=r"poses\.neutral\.scan"):
        phantom_hand.generate_pose(data.model_copy(update={"poses": {"neutral": scanned}}), "neutral")
    more = {**data.bones, "scaphoid": Bone(label=40)}
    with pytest.raises(InputError, match=r"bones\.scaphoid"):
        phantom_hand.generate_pose(data.model_copy(update={"bones": more}), "neutral")
    with pytest.raises(InputError, match="wave"):
        phantom_hand.posture("wave", 1)
    assert json.loads(data.model_dump_json())["poses"]["fist"]["seeds"] is None
