"""The phantom finger's truth and files, checked with other libraries than those that made them."""

import json
from pathlib import Path

import igl
import ipctk
import nibabel
import numpy as np
import pytest
import trimesh
from scipy.ndimage import binary_erosion, distance_transform_edt

from handpipe.core import artifacts
from handpipe.core.configuration.dataset import Dataset, load_dataset
from handpipe.core.errors import InputError
from handpipe.synthetic import generators
from handpipe.synthetic.acquisition import image, posed
from handpipe.synthetic.phantom import phantom_finger

POSES = list(phantom_finger.POSES)
CONFIG = Path(__file__).parents[2] / "config/datasets/phantom-finger.yaml"


@pytest.fixture(scope="module")
def fingers() -> dict[str, posed.PosedAnatomy]:
    return {p: phantom_finger.finger().posed(phantom_finger.posture(p, 1)) for p in POSES}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Dataset:
    found = load_dataset(CONFIG).model_copy(update={"root": tmp_path_factory.mktemp("phantom")})
    generator = generators.generator_of(found)
    generator.generate_templates(found)
    for pose in ("neutral", "fist"):
        generator.generate_pose(found, pose)
    return found


def volume(surface) -> float:
    return trimesh.Trimesh(*surface, process=False).volume


def distance(points, surface) -> np.ndarray:
    """Signed, negative inside."""
    return igl.signed_distance(points, surface[0], surface[1])[0]


def intersects_itself(surface) -> bool:
    mesh = ipctk.CollisionMesh(surface[0], igl.edges(surface[1]), surface[1].astype(np.int32))
    return ipctk.has_intersections(mesh, surface[0])


def organs(finger):
    return {**finger.bones, **finger.muscles, **finger.ligaments}


def test_neutral_surfaces_are_closed_and_outward(fingers):
    finger = fingers["neutral"]
    for surface in (
        *organs(finger).values(),
        *finger.marrow.values(),
        *finger.tendon_tubes.values(),
        finger.skin,
    ):
        mesh = trimesh.Trimesh(*surface, process=False)
        assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
        assert mesh.euler_number == 2


@pytest.mark.parametrize("pose", POSES)
def test_nothing_overlaps(fingers, pose):
    finger = fingers[pose]
    inner = {**organs(finger), **finger.tendon_tubes}
    assert distance(np.concatenate([points[::3] for points, _ in inner.values()]), finger.skin).max() < -0.7
    for name, surface in organs(finger).items():
        low, high = surface[0].min(axis=0), surface[0].max(axis=0)
        for other, (points, _) in organs(finger).items():
            near = points[((points > low) & (points < high)).all(axis=1)]
            if other != name and len(near):
                assert distance(near, surface).min() > -1e-3, (other, name)
    for name, line in finger.tendons.items():
        radius = phantom_finger.finger().tendons[name].radius
        for bone, surface in finger.bones.items():
            assert distance(line[::2], surface).min() > radius - 0.1, (name, bone)


@pytest.mark.parametrize("pose", POSES)
def test_skin_does_not_fold(fingers, pose):
    finger, anatomy = fingers[pose], phantom_finger.finger()
    assert not intersects_itself(finger.skin)
    growth = {name: muscle.pose(finger.posture)[2] for name, muscle in anatomy.muscles.items()}
    points = np.concatenate([anatomy.skin_surface[0] * [1.0, s, s] for s in (1.0, 0.9, 0.7)])
    step = 1e-3 * np.eye(3)
    columns = [
        (
            anatomy.skin.pose(points + e, finger.posture, growth)
            - anatomy.skin.pose(points - e, finger.posture, growth)
        )
        for e in step
    ]
    assert np.linalg.det(np.stack(columns, axis=-1) / 2e-3).min() > 0.15


def test_muscles_keep_their_volume_and_touch(fingers):
    for name, surface in fingers["neutral"].muscles.items():
        rest = volume(surface)
        for pose in POSES:
            assert volume(fingers[pose].muscles[name]) == pytest.approx(rest, rel=1e-4)
    for finger in fingers.values():
        upper, lower = finger.muscles.values()
        touching = np.abs(distance(upper[0], lower)) < 0.15
        assert touching.sum() > 100


def test_muscle_bulges_when_the_joint_flexes(fingers):
    """The belly's widest section grows from neutral to bow."""

    def girth(pose):
        surface = trimesh.Trimesh(*fingers[pose].muscles["dorsal_interosseous1"], process=False)
        metacarpal = fingers[pose].transforms["metacarpal2"]
        normal = metacarpal.rotation[:, 0]
        origin = metacarpal(np.array([[33.0, 0.0, 0.0]]))[0]
        return surface.section(plane_origin=origin, plane_normal=normal).length

    assert girth("bow") > 1.03 * girth("neutral")


def test_muscle_ends_move_with_their_bones(fingers):
    anatomy = phantom_finger.finger()
    for name, muscle in anatomy.muscles.items():
        neutral, _ = muscle.surface()
        x = neutral[:, 0]
        for finger in fingers.values():
            posed = finger.muscles[name][0]
            for end, bone in ((x < 13.0, "metacarpal2"), (x > 70.0, "proximal2")):
                np.testing.assert_allclose(posed[end], finger.transforms[bone](neutral[end]), atol=1e-9)


def test_tendons_keep_their_length(fingers):
    for name, line in fingers["neutral"].tendons.items():
        rest = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
        for finger in fingers.values():
            length = np.linalg.norm(np.diff(finger.tendons[name], axis=0), axis=1).sum()
            assert length == pytest.approx(rest, rel=5e-4)
            bone = finger.transforms["distal2"].inverse()
            assert np.linalg.norm(bone(finger.tendons[name][:1]) - line[0]) < 0.3


def test_transforms_carry_neutral_bones_and_nail(fingers):
    neutral = fingers["neutral"]
    nail = phantom_finger.finger().nail
    used = np.unique(neutral.skin[1][nail])
    for finger in fingers.values():
        for name, transform in finger.transforms.items():
            np.testing.assert_allclose(finger.bones[name][0], transform(neutral.bones[name][0]), atol=1e-9)
        np.testing.assert_allclose(
            finger.skin[0][used], finger.nails["nail2"][1](neutral.skin[0][used]), atol=1e-9
        )


def test_root_is_repositioned_a_little():
    for pose in POSES:
        root = phantom_finger.posture(pose, 1).root
        turned, moved = np.degrees(np.linalg.norm(root.rotation_vector())), np.linalg.norm(root.translation)
        if pose == "neutral":
            assert turned == 0.0 and moved == 0.0
        else:
            assert 1.0 < turned <= 5.0 and 1.0 < moved <= 6.0


def test_unknown_pose_is_refused():
    with pytest.raises(InputError, match="not a pose of the phantom"):
        phantom_finger.posture("wave", 1)


def test_all_named_files_are_written(dataset):
    organs = [*dataset.muscles.values(), *dataset.ligaments.values()]
    files = [path for organ in organs for path in (organ.template, organ.attachments)]
    files += [bone.template for bone in dataset.bones.values()]
    files += [tendon.path for tendon in dataset.tendons.values()]
    files += [nail.surface for nail in dataset.nails.values()]
    for pose in ("neutral", "fist"):
        files += [dataset.poses[pose].volume, dataset.poses[pose].seeds, dataset.poses[pose].scan]
        files += [f"truth/{pose}{end}" for end in (".h5", ".bones.nii.gz", ".marrow.nii.gz")]
    for file in files:
        assert dataset.path(file).exists(), file


def test_a_dataset_without_generator_is_refused(dataset):
    with pytest.raises(InputError, match="generator"):
        generators.generator_of(dataset.model_copy(update={"generator": None}))


def test_same_seed_same_files(dataset, tmp_path):
    again = dataset.model_copy(update={"root": tmp_path})
    phantom_finger.generate_pose(again, "fist")
    first = nibabel.load(dataset.path(dataset.poses["fist"].volume)).get_fdata()
    second = nibabel.load(again.path(again.poses["fist"].volume)).get_fdata()
    np.testing.assert_array_equal(first, second)


def test_tissues_have_their_intensities(fingers):
    finger = fingers["bow"]
    grid = image.VoxelGrid.around(finger.skin[0], 6.0, 0.8)
    clean = image.paint_layers(posed.layers(finger, grid), image.INTENSITIES, grid)
    scanned, bias, gain = image.acquire(clean, grid, np.random.default_rng(4), noise=0.03)
    corrected = scanned / (gain * bias)
    regions = {
        "marrow": finger.marrow["metacarpal2"],
        "muscle": finger.muscles["dorsal_interosseous1"],
    }
    for tissue, surface in regions.items():
        inside = binary_erosion(image.occupancy(surface, grid) == 1.0)
        assert inside.sum() > 200
        # Rician mean exceeds the signal by about sigma^2 / 2 s, far below the tolerance.
        assert corrected[inside].mean() == pytest.approx(image.INTENSITIES[tissue], abs=0.006)
    air = binary_erosion(image.occupancy(finger.skin, grid) == 0.0)
    assert corrected[air].mean() < 0.06


def test_volume_and_labels_show_the_truth(dataset):
    truth = artifacts.read(dataset.root / "truth/fist.h5", "truth")
    labels = nibabel.load(dataset.root / "truth/fist.bones.nii.gz")
    volume_image = nibabel.load(dataset.path(dataset.poses["fist"].volume))
    assert labels.shape == volume_image.shape
    np.testing.assert_allclose(labels.affine, volume_image.affine)
    assert volume_image.get_data_dtype() == np.float32
    assert np.linalg.det(volume_image.affine[:3, :3]) > 0
    for name, bone in dataset.bones.items():
        surface = truth["bones"][name]["vertices"], truth["bones"][name]["triangles"]
        count = (labels.get_fdata() == bone.label).sum() * 0.8**3
        assert count == pytest.approx(volume(surface), rel=0.03)


def test_seeds_are_few_and_right(dataset):
    for pose in ("neutral", "fist"):
        seeds = np.asarray(nibabel.load(dataset.path(dataset.poses[pose].seeds)).dataobj)
        marrow = np.asarray(nibabel.load(dataset.root / f"truth/{pose}.marrow.nii.gz").dataobj)
        whole = np.asarray(nibabel.load(dataset.root / f"truth/{pose}.bones.nii.gz").dataobj)
        assert seeds.dtype == np.uint8
        for bone in dataset.bones.values():
            drawn = seeds == bone.label
            assert 15 <= drawn.sum() <= 100
            assert np.all(marrow[drawn] == bone.label)
            near = distance_transform_edt(whole != bone.label) * 0.8 < 6.5
            assert (near & (seeds == 255)).sum() >= 15
        assert np.all(whole[seeds == 255] == 0)


def test_scan_lies_on_the_skin_and_has_holes(dataset):
    truth = artifacts.read(dataset.root / "truth/fist.h5", "truth")
    scan = trimesh.load(dataset.path(dataset.poses["fist"].scan), process=False)
    away = np.abs(
        distance(
            np.asarray(scan.vertices, dtype=float), (truth["skin"]["vertices"], truth["skin"]["triangles"])
        )
    )
    assert away.max() < 0.15
    edges, count = np.unique(np.sort(scan.edges, axis=1), axis=0, return_counts=True)
    border = edges[count == 1]
    assert len(trimesh.graph.connected_components(border)) >= 3
    assert count.max() == 2
    assert np.linalg.norm(np.diff(scan.vertices[edges], axis=1), axis=2).mean() < 1.1


def test_templates_differ_from_the_truth_and_attach_at_their_ends(dataset):
    truth = artifacts.read(dataset.root / "truth/neutral.h5", "truth")
    for name, muscle in dataset.muscles.items():
        mesh = trimesh.load(dataset.path(muscle.template), process=False)
        assert mesh.is_watertight and mesh.volume > 0
        assert 400 <= len(mesh.vertices) <= 900
        true = truth["muscles"][name]
        rest = volume((true["vertices"], true["triangles"]))
        assert 1.2 * rest < mesh.volume < 2.0 * rest
        attachments = json.loads(dataset.path(muscle.attachments).read_text(encoding="utf-8"))
        assert list(attachments) == ["metacarpal2", "proximal2"]
        for bone, ids in attachments.items():
            template = trimesh.load(dataset.path(dataset.bones[bone].template), process=False)
            reach = distance(np.asarray(mesh.vertices, dtype=float)[ids], (template.vertices, template.faces))
            assert reach.min() < 2.0


def test_curves_are_points_along_the_tendons_from_the_insertion(dataset):
    truth = artifacts.read(dataset.root / "truth/neutral.h5", "truth")
    for name, tendon in dataset.tendons.items():
        markup = json.loads(dataset.path(tendon.path).read_text(encoding="utf-8"))["markups"][0]
        points = np.array([p["position"] for p in markup["controlPoints"]])
        assert markup["coordinateSystem"] == "RAS"
        line = truth["tendons"][name]["centreline"]
        away = np.linalg.norm(points[:, None] - line[None], axis=2)
        assert away.min(axis=1).max() < 1.5
        assert np.all(np.diff(away.argmin(axis=1)) > 0)


def test_nail_patch_is_open_and_lies_on_the_skin(dataset):
    truth = artifacts.read(dataset.root / "truth/neutral.h5", "truth")
    patch = trimesh.load(dataset.path(dataset.nails["nail2"].surface), process=False)
    assert not patch.is_watertight and patch.area > 50.0
    away = distance(
        np.asarray(patch.vertices, dtype=float), (truth["skin"]["vertices"], truth["skin"]["triangles"])
    )
    assert np.abs(away).max() < 1e-4
