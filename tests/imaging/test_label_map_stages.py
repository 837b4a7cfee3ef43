"""A label map in place of seeds, through the stages: the phantom finger's true labels and surfaces."""

import igl
import numpy as np
import pytest
from scipy.spatial import cKDTree

from handpipe.core.configuration.dataset import Dataset, load_dataset
from handpipe.core.errors import InputError
from handpipe.hand import labelled_muscles, require_seeds
from handpipe.imaging.volumes import rasterise, read_labels, read_volume, write_segments
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.bones import read_surfaces
from handpipe.stages.images import correct_bone, merge_labels, segment_pose
from handpipe.synthetic import generators
from handpipe.synthetic.phantom import phantom_finger

QUARTER = 0.125  # mm, of the finger's voxels of 0.5 mm


@pytest.fixture(scope="module")
def finger(tmp_path_factory) -> Dataset:
    found = load_dataset("config/datasets/phantom-finger.yaml")
    found = found.model_copy(update={"root": tmp_path_factory.mktemp("phantom")})
    generator = generators.generator_of(found)
    generator.generate_templates(found)
    for pose in ("neutral", "fist"):
        generator.generate_pose(found, pose)
    return found


@pytest.fixture(scope="module")
def truth():
    return {
        pose: phantom_finger.finger().posed(phantom_finger.posture(pose, 1)) for pose in ("neutral", "fist")
    }


def with_map(finger: Dataset, pose: str, shown: str, bones: list[str], seeds: bool) -> Dataset:
    """The finger with a segmentation of some bones' true labels in one pose, with or without its seeds."""
    path = finger.root / f"{pose}-{shown}-{len(bones)}.seg.nrrd"
    true = finger.root / f"truth/{pose}.{'bones' if shown == 'whole' else 'marrow'}.nii.gz"
    labels = read_labels(true)
    kept = {name: finger.labels[name] for name in bones}
    write_segments(
        path, np.where(np.isin(labels, [*kept.values()]), labels, 0), read_volume(true).affine, kept
    )
    update = {"labels": path.relative_to(finger.root), "labels_show": shown}
    update |= {} if seeds else {"seeds": None}
    poses = {pose: finger.poses[pose].model_copy(update=update)}
    return finger.model_copy(update={"poses": {**finger.poses, **poses}})


def built(dataset: Dataset, pose: str, folder):
    """Surfaces and labels of a pose by the two stages."""
    given = dataset.poses[pose]
    volume, labels = dataset.path(given.volume), dataset.path(given.labels)
    seeds = dataset.path(given.seeds) if given.seeds else None
    found = segment_pose.Inputs(volume, seeds, labels)
    segment_pose.segment_pose(found, folder / "bones.h5", dataset, pose, ())
    inputs = merge_labels.Inputs(volume, seeds, folder / "bones.h5", (), (), None, labels)
    names = ("labels.nii.gz", "labels.json", "surfaces.h5", "looks.json")
    outputs = merge_labels.Outputs(*(folder / name for name in names))
    merge_labels.merge_labels(inputs, outputs, dataset, pose)
    return outputs


def error(surface, true) -> float:
    """Mean distance in mm between two surfaces, both ways."""
    there = igl.point_mesh_squared_distance(surface.vertices, *true)[0]
    back = igl.point_mesh_squared_distance(true[0], surface.vertices, surface.triangles)[0]
    return 0.5 * float(np.sqrt(there).mean() + np.sqrt(back).mean())


def test_whole_bones_of_neutral_need_no_seeds(finger, truth, tmp_path) -> None:
    dataset = with_map(finger, "neutral", "whole", [*finger.bones], seeds=False)
    outputs = built(dataset, "neutral", tmp_path)
    whole, marrow = (read_surfaces(outputs.surfaces, part) for part in ("whole", "marrow"))
    assert {*whole} == {*finger.bones}
    for name in finger.bones:
        assert error(whole[name], truth["neutral"].bones[name]) < QUARTER
        assert error(marrow[name], truth["neutral"].marrow[name]) < QUARTER


def test_marrow_of_a_pose_is_that_of_the_map(finger, truth, tmp_path) -> None:
    dataset = with_map(finger, "fist", "marrow", [*finger.bones], seeds=False)
    marrow = read_surfaces(built(dataset, "fist", tmp_path).surfaces, "marrow")
    for name in finger.bones:
        assert error(marrow[name], truth["fist"].marrow[name]) < QUARTER


def test_bones_that_the_map_lacks_are_segmented_from_seeds(finger, truth, tmp_path) -> None:
    dataset = with_map(finger, "neutral", "whole", ["metacarpal2", "middle2"], seeds=True)
    outputs = built(dataset, "neutral", tmp_path)
    whole = read_surfaces(outputs.surfaces, "whole")
    for name in finger.bones:
        assert error(whole[name], truth["neutral"].bones[name]) < QUARTER
    labels = read_labels(outputs.labels)
    true = read_labels(finger.root / "truth/neutral.bones.nii.gz")
    for name, label in finger.labels.items():
        both = ((labels == label) & (true == label)).sum()
        assert 2 * both / ((labels == label).sum() + (true == label).sum()) > 0.95, name


def test_bones_without_label_and_seeds_are_named(finger) -> None:
    dataset = with_map(finger, "neutral", "whole", ["metacarpal2", "middle2"], seeds=False)
    missing = {"neutral": ["proximal2", "distal2"], "bow": []}
    with pytest.raises(InputError, match=r"poses\.neutral\.labels: .* lacks proximal2, distal2"):
        require_seeds("finger.yaml", dataset, missing)
    require_seeds("finger.yaml", dataset, {"neutral": [], "bow": ["proximal2"]})
    with pytest.raises(InputError, match=r"poses\.bow\.labels"):
        require_seeds("finger.yaml", dataset, {"neutral": [], "bow": ["proximal2"]}, whole=False)


def test_scribbles_of_a_bone_of_the_map_are_refused(finger, tmp_path) -> None:
    dataset = with_map(finger, "neutral", "whole", ["metacarpal2", "middle2"], seeds=True)
    given = dataset.poses["neutral"]
    seeds = dataset.path(given.seeds)
    inputs = correct_bone.Inputs(dataset.path(given.volume), seeds, seeds, dataset.path(given.labels))
    with pytest.raises(InputError, match="scribbles of middle2: are given, but .* holds the bone, too"):
        correct_bone.correct_bone(inputs, tmp_path / "b.h5", dataset, "neutral", "middle2")


def test_a_muscle_of_the_map_gives_points_on_its_boundary(finger, truth, tmp_path) -> None:
    volume = read_volume(finger.root / "volumes/neutral.nii.gz")
    true = {name: Surface(*s) for name, s in truth["neutral"].muscles.items()}
    labels = rasterise(volume, dict(enumerate(true.values(), 1)))
    path = tmp_path / "muscles.seg.nrrd"
    write_segments(path, labels, volume.affine, {name: i for i, name in enumerate(true, 1)})
    points = labelled_muscles(path, finger)
    assert {*points} == {*finger.muscles}
    for name, surface in true.items():
        away = igl.point_mesh_squared_distance(points[name], surface.vertices, surface.triangles)[0]
        assert np.sqrt(away).mean() < 0.2
        assert cKDTree(points[name]).query(surface.vertices)[0].max() < 3.0
