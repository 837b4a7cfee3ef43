"""The finger of real anatomy, where its source data are at hand."""

import json
from pathlib import Path

import igl
import ipctk
import nibabel
import numpy as np
import pytest
import trimesh

from handpipe.core import artifacts
from handpipe.core.configuration.dataset import Dataset, load_dataset
from handpipe.core.errors import InputError
from handpipe.synthetic.real_anatomy import zanatomy_index

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Dataset:
    found = load_dataset(ROOT / "config/datasets/zanatomy-index.yaml")
    folder = (ROOT / found.anatomy).resolve()
    if not folder.exists():
        pytest.skip("the source anatomy is not on this machine")
    return found.model_copy(update={"root": tmp_path_factory.mktemp("zanatomy"), "anatomy": folder})


@pytest.fixture(scope="module")
def fingers(dataset):
    anatomy = zanatomy_index.finger(dataset.anatomy)
    return {p: anatomy.posed(zanatomy_index.posture(dataset, p)) for p in ("neutral", "fist", "spread")}


def distance(points, surface):
    return igl.signed_distance(points, surface[0], surface[1])[0]


def test_absent_anatomy_is_named(dataset):
    absent = dataset.model_copy(update={"anatomy": Path("nowhere")})
    with pytest.raises(InputError, match="anatomy: nowhere does not exist"):
        zanatomy_index.generate_pose(absent, "neutral")


def test_an_incomplete_anatomy_names_the_file(dataset, tmp_path):
    with pytest.raises(InputError, match="Second_metacarpal"):
        zanatomy_index.generate_pose(dataset.model_copy(update={"anatomy": tmp_path}), "neutral")


def test_joints_lie_between_their_bones(dataset):
    """Centres lie inside the parent's head, axes point radially and dorsally."""
    anatomy = zanatomy_index.finger(dataset.anatomy)
    for joint in anatomy.joints:
        assert distance(joint.centre[None], anatomy.bones[joint.parent])[0] < 0.0
        assert joint.axes[0] @ [0.0, 1.0, 0.0] > 0.9
    assert anatomy.joints[0].axes[1] @ [0.0, 0.0, 1.0] > 0.9


def test_nothing_overlaps(fingers):
    for pose, finger in fingers.items():
        organs = {**finger.bones, **finger.muscles}
        for name, surface in organs.items():
            assert trimesh.Trimesh(*surface, process=False).is_watertight
            assert distance(surface[0], finger.skin).max() < -0.7, (pose, name)
            for other, (points, _) in organs.items():
                if other != name:
                    assert distance(points, surface).min() > -0.2, (pose, other, name)
        for name, tube in finger.tendon_tubes.items():
            assert distance(tube[0], finger.skin).max() < -0.5, (pose, name)
            for surface in finger.bones.values():
                assert distance(finger.tendons[name], surface).min() > finger.tendon_radii[name] - 0.1
        skin = ipctk.CollisionMesh(finger.skin[0], igl.edges(finger.skin[1]), finger.skin[1].astype(np.int32))
        assert not ipctk.has_intersections(skin, finger.skin[0])


def test_muscle_volumes_and_tendon_lengths_stay(fingers):
    neutral = fingers["neutral"]
    for finger in fingers.values():
        for name, surface in finger.muscles.items():
            rest = trimesh.Trimesh(*neutral.muscles[name], process=False).volume
            assert trimesh.Trimesh(*surface, process=False).volume == pytest.approx(rest, rel=5e-3)
        for name, line in finger.tendons.items():
            rest = np.linalg.norm(np.diff(neutral.tendons[name], axis=0), axis=1).sum()
            assert np.linalg.norm(np.diff(line, axis=0), axis=1).sum() == pytest.approx(rest, rel=5e-4)


def test_files_of_a_pose(dataset):
    zanatomy_index.generate_pose(dataset, "hook")
    truth = artifacts.read(dataset.root / "truth/hook.h5", "truth")
    scan = trimesh.load(dataset.path(dataset.poses["hook"].scan), process=False)
    skin = truth["skin"]["vertices"], truth["skin"]["triangles"]
    assert np.abs(distance(np.asarray(scan.vertices, dtype=float), skin)).max() < 0.15
    assert not scan.is_watertight
    seeds = np.asarray(nibabel.load(dataset.path(dataset.poses["hook"].seeds)).dataobj)
    marrow = np.asarray(nibabel.load(dataset.root / "truth/hook.marrow.nii.gz").dataobj)
    for bone in dataset.bones.values():
        assert (seeds == bone.label).sum() >= 8
        assert np.all(marrow[seeds == bone.label] == bone.label)


def test_templates(dataset):
    zanatomy_index.generate_templates(dataset)
    for muscle in dataset.muscles.values():
        mesh = trimesh.load(dataset.path(muscle.template), process=False)
        assert mesh.is_watertight and mesh.volume > 0
        attachments = json.loads(dataset.path(muscle.attachments).read_text(encoding="utf-8"))
        assert all(len(ids) >= 3 and max(ids) < len(mesh.vertices) for ids in attachments.values())
    for nail in dataset.nails.values():
        assert 40.0 < trimesh.load(dataset.path(nail.surface), process=False).area < 200.0
