"""The neutral image moved with a made-up limb, whose motion and images are known in closed form."""

import csv
import json
from pathlib import Path

import nibabel
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from tests.mesh.shapes import box, box_tets

from handpipe.core import metrics
from handpipe.core.configuration.dataset import Dataset
from handpipe.core.configuration.scene import Scene
from handpipe.core.errors import InputError
from handpipe.core.layers import Frame, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.evaluation.moved_images.planes import anatomical_planes
from handpipe.hand.frames import write_frames
from handpipe.hand.moved_image import grid_around, places_in_neutral, skin_of
from handpipe.imaging.volumes.volume import Volume, write_volume
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.joint_tree import FittedPose, RigJoint
from handpipe.skeleton.joints.joints import JointFit
from handpipe.skeleton.joints.residual import Residual
from handpipe.skeleton.rig.rig import Rig
from handpipe.stages.views import evaluate_images, move_image, move_images

START, SIZE = np.array([-8.0, -8.0, -8.0]), np.array([36.0, 16.0, 16.0])
SHIFT = 5.0  # mm of the far bone, away from the near one; between x = 4 and 16 the tissue is stretched
ROOT = RigidTransform(Rotation.from_rotvec([0.1, 0, 0.3]).as_matrix(), np.array([3.0, -2.0, 5.0]))
ANGLES = {"hinge_flexion": 0.0}
MIDDLES = {"near": 0.0, "far": 20.0}


def moved(points: np.ndarray, share: float = 1.0) -> np.ndarray:
    x = points[:, 0]
    return points + np.outer(share * np.interp(x, [4, 16], [0, SHIFT]), [1, 0, 0])


def back(points: np.ndarray) -> np.ndarray:
    x = np.interp(points[:, 0], [-50, 4, 16 + SHIFT, 60 + SHIFT], [-50, 4, 16, 60])
    return np.column_stack([x, points[:, 1:]])


def evenly(points: np.ndarray, share: float) -> np.ndarray:
    """Another motion of the same ends: one even stretch."""
    return points + np.outer(share * SHIFT * (points[:, 0] - START[0]) / SIZE[0], [1, 0, 0])


def texture(points: np.ndarray) -> np.ndarray:
    """Without an edge at the skin, whose partial volume is another matter."""
    x, y, z = points.T
    return 120 + 30 * np.sin(x / 2) + 30 * np.cos(y / 2 + x / 9) + 30 * np.sin(z / 2)


def outward(surface: Surface) -> Surface:
    return surface if surface.volume() > 0 else surface.flipped()


def ball(bone: str) -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=3.5)
    return Surface(np.asarray(mesh.vertices) + [MIDDLES[bone], 0, 0], np.asarray(mesh.faces))


def skin() -> Surface:
    sides = outward(box(tuple(SIZE)))
    return sides.moved(sides.vertices + START)


def limb(name: str, share: float):
    """A frame with its bones, and with its fat by the true motion and by another one."""
    steps = {"near": 0.0, "far": share * SHIFT}
    bones = {b: RigidTransform(np.eye(3), np.array([x, 0, 0])) for b, x in steps.items()}
    solid = {b: Shape(ball(b).vertices, t(ball(b).vertices), ball(b).triangles) for b, t in bones.items()}
    tets, closed = box_tets(9), skin()
    rest = START + tets.vertices * SIZE
    fats = {
        name: {
            "skin": Shape(closed.vertices, motion(closed.vertices, share), closed.triangles),
            f"{part}_mesh": Shape(rest, motion(rest, share), tets.tets),
        }
        for name, part, motion in (("m0", "fat", moved), ("m2", "skin", evenly))
    }
    return Frame(name, ANGLES, bones), {"bones": solid}, fats


def volume(affine: np.ndarray, values) -> Volume:
    shape = (64, 44, 48)
    points = np.indices(shape).reshape(3, -1).T @ affine[:3, :3].T + affine[:3, 3]
    return Volume(values(points).reshape(shape).astype(np.float32), affine)


def rig() -> Rig:
    still = Residual(np.zeros((2, 3)), *np.radians([[-10.0, 90.0]]).T)
    axis = Axes(np.array([[0.0, 1, 0]]), (0,))
    fit = JointFit(axis, np.array([10.0, 0, 0]), still, still, np.zeros((0, 1)))
    joint = RigJoint("hinge", "near", "far", ("hinge_flexion",), np.radians([[-10.0, 90.0]]), fit)
    poses = {"flat": FittedPose(RigidTransform.identity(), ANGLES), "drawn": FittedPose(ROOT, ANGLES)}
    return Rig("near", (joint,), {bone: ball(bone) for bone in MIDDLES}, poses)


@pytest.fixture(scope="module")
def subject(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Dataset]:
    folder = tmp_path_factory.mktemp("limb")
    rig().save(folder / "rig.h5")
    affine = np.diag([0.8, 0.8, 0.8, 1.0])
    affine[:3, 3] = [-12, -17, -18]
    write_volume(folder / "flat.nii.gz", volume(affine, texture))
    posed = volume(affine, lambda points: 2 * texture(back(ROOT.inverse()(points))) + 10)
    write_volume(folder / "drawn.nii.gz", posed)
    frame, bones, fats = limb("drawn", 1.0)
    write_frames(folder / "inner.h5", [(frame, bones)])
    write_frames(folder / "skin.h5", [(frame, {"m0": fats["m0"]})])
    write_frames(folder / "passive_skin.h5", [(frame, {"m2": fats["m2"]})])
    scene = [limb("rest", 0.0), limb("half", 0.5), limb("full", 1.0)]
    for chunk, frames in enumerate((scene[:2], scene[2:])):
        simulated = [(f, below | {"fat": fat["m0"]}) for f, below, fat in frames]
        write_frames(folder / f"frames-{chunk}.h5", simulated)
    poses = {"flat": "neutral", "drawn": "heldout"}
    content = {
        "name": "limb",
        "root": folder,
        "poses": {
            pose: {"role": role, "volume": f"{pose}.nii.gz", "seeds": f"{pose}-seeds.nii.gz"}
            for pose, role in poses.items()
        },
        "bones": {"near": {"label": 1}, "far": {"label": 2}},
        "joints": {
            "hinge": {
                "parent": "near",
                "child": "far",
                "angles": list(ANGLES),
                "limits_deg": [[-10, 90]],
                "axis_hints": [[0, 1, 0]],
            }
        },
    }
    return folder, Dataset.model_validate(content)


@pytest.fixture(scope="module")
def row(subject: tuple[Path, Dataset]) -> dict[str, float]:
    folder, dataset = subject
    inputs = move_image.Inputs(
        folder / "rig.h5",
        folder / "inner.h5",
        folder / "skin.h5",
        folder / "passive_skin.h5",
        folder / "flat.nii.gz",
        folder / "drawn.nii.gz",
    )
    outputs = move_image.Outputs(folder / "moved.nii.gz", folder / "moved.png", folder / "moved.json")
    move_image.move_image(inputs, outputs, dataset, "drawn")
    return json.loads(outputs.table.read_text(encoding="utf-8"))


def test_likeness_is_that_of_the_true_motion_and_less_for_others(row: dict[str, float]) -> None:
    """Gain and offset of the pose's image do not count; rigidly moved, its far end is 5 mm off."""
    assert row["correlation_layers"] > 0.97
    assert row["correlation_layers"] - 0.01 > row["correlation_one_tissue"] > row["correlation_rigid"] + 0.05
    assert row["local_correlation_layers"] > 0.95
    assert row["local_correlation_layers"] - 0.01 > row["local_correlation_one_tissue"]
    assert (row["pose"], row["role"], row["imaged_layers"]) == ("drawn", "heldout", 1.0)
    assert row["filled"] < 0.01


def test_moved_image_lies_on_the_grid_of_the_pose(subject: tuple[Path, Dataset], row: object) -> None:
    folder, _ = subject
    scan, image = (nibabel.load(folder / f"{name}.nii.gz") for name in ("drawn", "moved"))
    np.testing.assert_allclose(image.affine, scan.affine)
    seen, own = np.asarray(image.dataobj), np.asarray(scan.dataobj)
    assert seen.shape == own.shape
    both = (seen > 0) & (own > 10)
    assert both.sum() > 0.98 * (seen > 0).sum()
    assert np.median(np.abs(seen - (own - 10) / 2)[both]) < 2
    assert (folder / "moved.png").read_bytes()[:4] == b"\x89PNG"


def test_figures_are_means_and_minima_over_the_poses_of_a_role(tmp_path: Path, row: dict) -> None:
    rows = [row, {**row, "pose": "other", "correlation_layers": 0.5}, {**row, "pose": "e", "role": "example"}]
    for each in rows:
        (tmp_path / f"{each['pose']}.json").write_text(json.dumps(each))
    inputs = evaluate_images.Inputs([tmp_path / f"{each['pose']}.json" for each in rows])
    outputs = evaluate_images.Outputs(tmp_path / "metrics.json", tmp_path / "table.json")
    evaluate_images.evaluate_images(inputs, outputs, [])
    found = metrics.read(outputs.metrics)
    mean = (row["correlation_layers"] + 0.5) / 2
    assert found["heldout_correlation_layers_mean"] == (pytest.approx(mean), "1")
    assert found["heldout_correlation_layers_min"] == (0.5, "1")
    assert found["correlation_layers_other"] == (0.5, "1")
    assert found["example_correlation_rigid_mean"][0] == row["correlation_rigid"]
    assert json.loads(outputs.table.read_text(encoding="utf-8")) == rows


def test_a_scene_gets_a_series_on_one_grid(subject: tuple[Path, Dataset], tmp_path: Path) -> None:
    folder, dataset = subject
    chunks = [folder / f"frames-{chunk}.h5" for chunk in (0, 1)]
    inputs = move_images.Inputs(folder / "rig.h5", folder / "flat.nii.gz", chunks)
    move_images.move_images(inputs, tmp_path / "images", dataset)
    names = ["rest", "half", "full"]
    listed = list(csv.DictReader((tmp_path / "images/frames.csv").open(encoding="utf-8")))
    assert [each["frame"] for each in listed] == names
    series = [nibabel.load(tmp_path / f"images/frame-{i:04d}.nii.gz") for i in range(3)]
    assert len({image.shape for image in series}) == 1
    for image, share in zip(series, (0.0, 0.5, 1.0), strict=True):
        values = np.asarray(image.dataobj)
        inside = np.argwhere(values > 0)
        places = inside @ image.affine[:3, :3].T + image.affine[:3, 3]
        x = np.interp(places[:, 0], [-50, 4, 16 + share * SHIFT, 60 + share * SHIFT], [-50, 4, 16, 60])
        true = texture(np.column_stack([x, places[:, 1:]]))
        end = START + SIZE + [share * SHIFT, 0, 0]
        deep = ((places > START + 1) & (places < end - 1)).all(axis=1)
        assert np.abs(values[tuple(inside.T)] - true)[deep].mean() < 2
        assert inside.shape[0] * 0.8**3 == pytest.approx((end - START).prod(), rel=0.05)
    assert len([*(tmp_path / "images").glob("*.png")]) == 3


def test_voxels_of_bones_are_exactly_rigid() -> None:
    frame, bones, fats = limb("full", 1.0)
    layers = bones | {"fat": fats["m2"]}  # fat whose motion is not that of the bones
    grid = grid_around([skin_of(layers)], 1.0)
    places = places_in_neutral(grid, frame, layers)
    where = grid.to_world(places.voxels)
    for bone, shift in (("near", 0.0), ("far", SHIFT)):
        deep = np.linalg.norm(where - [MIDDLES[bone] + shift, 0, 0], axis=1) < 3.3
        assert deep.sum() > 100
        np.testing.assert_allclose(places.rest[deep], where[deep] - [shift, 0, 0], atol=1e-12)


def test_planes_follow_the_finger_and_not_the_axes() -> None:
    """Turned as a whole, the planes turn with it."""
    frame, bones, _ = limb("full", 1.0)
    turn = RigidTransform(Rotation.from_rotvec([0.3, -1.0, 0.5]).as_matrix(), np.array([1.0, 2, 3]))
    turned = Frame("turned", ANGLES, {b: turn @ t for b, t in frame.bones.items()})
    shapes = {b: Shape(s.rest, turn(s.vertices), s.cells) for b, s in bones["bones"].items()}
    still = anatomical_planes(rig(), frame, bones)
    for name, plane in anatomical_planes(rig(), turned, {"bones": shapes}).items():
        if name.startswith("transversal"):
            continue  # a ball has no axis
        for part in ("right", "up"):
            np.testing.assert_allclose(
                getattr(plane, part), turn.rotation @ getattr(still[name], part), atol=1e-9
            )
        np.testing.assert_allclose(plane.origin, turn(still[name].origin), atol=1e-9)
    np.testing.assert_allclose(still["sagittal"].up, [0, 0, 1], atol=1e-9)  # dorsal: flexion is about +y
    np.testing.assert_allclose(still["coronal"].up, [0, 1, 0], atol=1e-9)


def test_without_a_skin_there_is_no_image() -> None:
    with pytest.raises(InputError, match="no skin among bones"):
        skin_of(limb("full", 1.0)[1])
    with pytest.raises(ValueError, match="images: need fat or skin"):
        Scene(layers=("bones", "muscles"), frames=Path("a.csv"), images=True)
