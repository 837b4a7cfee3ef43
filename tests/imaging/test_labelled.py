"""A person's label map: its names, its surfaces against analytic shapes, and what of it is refused."""

import json

import nibabel
import numpy as np
import pytest
from benchmarks.trust.nrrd_rows import listed, segments
from phalanx import Phalanx, grid_points, points_of

from handpipe.core.errors import InputError
from handpipe.imaging.bone_surfaces import in_image, labelled_surfaces, marrow_surface
from handpipe.imaging.bone_surfaces.labelled import labelled_surface
from handpipe.imaging.segmentation import labelled_bone, require_shown
from handpipe.imaging.volumes import (
    Volume,
    labelled_names,
    read_label_map,
    write_label_description,
    write_segments,
)

BONES = {"near": 1, "far": 2}
NAMES = [*BONES, "flexor"]
SHAPE = (24, 16, 16)
AFFINE = np.diag([0.8, 0.8, 0.8, 1.0])


def blocks(**places: slice) -> np.ndarray:
    """Labels 1, 2, … of the given slices along x."""
    labels = np.zeros(SHAPE, np.uint8)
    for label, place in enumerate(places.values(), 1):
        labels[place, 4:12, 4:12] = label
    return labels


def masked(function, spacing) -> Volume:
    points, affine = points_of((-16, -9, -11), (16, 9, 9), spacing)
    return Volume((function(points) < 0).astype(np.float32), affine)


@pytest.mark.parametrize("spacing", [0.5, 0.8, (0.3, 0.3, 1.5)])
@pytest.mark.parametrize("part", ["marrow", "bone"])
def test_surface_is_within_a_quarter_voxel_of_the_true_one(part, spacing) -> None:
    truth = getattr(Phalanx(), part)
    surface = labelled_surface(masked(truth, spacing), "labels.nii.gz", "near")
    error = truth(surface.vertices)
    assert surface.is_closed()
    assert surface.volume() > 0
    assert np.abs(error).mean() < 0.3 * np.max(spacing) if np.ndim(spacing) else 0.25 * spacing
    assert abs(error.mean()) < 0.12 * np.max(spacing)


@pytest.mark.parametrize("radius", [1.2, 2.0, 4.0])
def test_a_small_ball_does_not_shrink(radius) -> None:
    middle = np.array([0.1, 0.2, 0.05])
    mask = masked(lambda points: np.linalg.norm(points - middle, axis=-1) - radius, 0.5)
    surface = labelled_surface(mask, "labels.nii.gz", "ball")
    assert surface.volume() == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.15)


def test_marrow_inside_a_whole_bone_is_found() -> None:
    truth = Phalanx()
    volume = truth.volume()
    whole = labelled_surface(masked(truth.bone, 0.5), "labels.nii.gz", "near")
    bone = labelled_bone(volume, whole, "whole", "labels.nii.gz", "near")
    marrow = marrow_surface(volume, bone)
    assert np.abs(truth.marrow(marrow.vertices)).mean() < 0.125
    claimed = np.zeros(volume.shape, bool)
    claimed[bone.slices] = bone.probability > 0.5
    assert not (claimed & (truth.bone(grid_points(volume)) > 0.25)).any()


def test_a_map_of_the_other_part_of_a_bone_is_refused() -> None:
    truth = Phalanx()
    volume = truth.volume()
    for part, said, found in (("marrow", "whole", "the marrow"), ("bone", "marrow", "whole bones")):
        surfaces = {"near": labelled_surface(masked(getattr(truth, part), 0.5), "labels.nii.gz", "near")}
        with pytest.raises(InputError, match=f"labels_show: is {said}.*they show {found}"):
            require_shown(volume, surfaces, said, "labels.nii.gz")
        require_shown(volume, surfaces, "whole" if said == "marrow" else "marrow", "labels.nii.gz")


def test_a_bone_without_bright_marrow_is_refused() -> None:
    truth = Phalanx()
    volume = truth.volume()
    surface = labelled_surface(masked(truth.bone, 0.5), "labels.nii.gz", "near")
    dark = volume.like(np.where(truth.bone(grid_points(volume)) < 0, 0.0, volume.values))
    with pytest.raises(InputError, match="near: the image shows no marrow in it"):
        labelled_bone(dark, surface, "whole", "labels.nii.gz", "near")


def test_names_of_a_segmentation_whatever_their_case(tmp_path) -> None:
    path = tmp_path / "a.seg.nrrd"
    labels = blocks(near=slice(2, 8), flexor=slice(12, 20))
    write_segments(path, labels, AFFINE, {"Near": 1, "FLEXOR": 2})
    assert labelled_names(path, BONES, NAMES) == ["near", "flexor"]
    found = read_label_map(path, BONES)
    for name, label in found.known(NAMES).items():
        mask = found.mask(label)
        expected = labels == {"near": 1, "flexor": 2}[name]
        assert mask.values.sum() == expected.sum()
        middle = mask.to_world(np.argwhere(mask.values > 0)).mean(axis=0)
        np.testing.assert_allclose(middle, 0.8 * np.argwhere(expected).mean(axis=0), atol=1e-6)


@pytest.mark.parametrize("table", ["json", "txt", "label", None])
def test_names_of_a_label_volume(tmp_path, table) -> None:
    path = tmp_path / "a.nii.gz"
    named = {"near": 7, "flexor": 40} if table else {"near": 1, "far": 2}
    labels = blocks(a=slice(2, 8), b=slice(12, 20))
    labels = np.array([0, *named.values()], np.uint8)[labels]
    nibabel.save(nibabel.Nifti1Image(labels, AFFINE), path)
    if table == "json":
        (tmp_path / "a.json").write_text(json.dumps(named))
    elif table:
        write_label_description(tmp_path / f"a.{table}", named)
    assert labelled_names(path, BONES, NAMES) == list(named)
    assert read_label_map(path, BONES).known(NAMES) == named


def test_unknown_names_are_refused_with_those_that_are_like_them(tmp_path) -> None:
    path = tmp_path / "a.seg.nrrd"
    write_segments(path, blocks(a=slice(2, 8), b=slice(12, 20)), AFFINE, {"nearr": 1, "skin": 2})
    with pytest.raises(InputError, match=r"'nearr' \(like near\), 'skin': no bone or muscle"):
        labelled_names(path, BONES, NAMES)
    path = tmp_path / "a.nii.gz"
    nibabel.save(nibabel.Nifti1Image(blocks(a=slice(2, 8), b=slice(9, 12), c=slice(14, 20)), AFFINE), path)
    with pytest.raises(InputError, match="'label 3'"):
        labelled_names(path, BONES, NAMES)


def test_a_map_of_nothing_is_refused(tmp_path) -> None:
    path = tmp_path / "a.nii.gz"
    nibabel.save(nibabel.Nifti1Image(np.zeros(SHAPE, np.uint8), AFFINE), path)
    with pytest.raises(InputError, match="holds no bone or muscle"):
        labelled_names(path, BONES, NAMES)


def test_an_empty_segment_is_refused(tmp_path) -> None:
    path = tmp_path / "a.seg.nrrd"
    write_segments(path, blocks(near=slice(2, 8)), AFFINE, BONES)
    found = read_label_map(path, BONES)
    with pytest.raises(InputError, match="far: is empty"):
        labelled_surfaces(found, found.known(BONES))


def test_segments_that_share_voxels_are_refused(tmp_path) -> None:
    path = tmp_path / "a.seg.nrrd"
    layers = np.stack([blocks(near=slice(2, 12)) > 0, blocks(far=slice(8, 20)) > 0]).astype(np.uint8)
    listed(path, layers, **segments(("near", 0, 1), ("far", 1, 1)))
    with pytest.raises(InputError, match="near and far share 256 voxels"):
        read_label_map(path, BONES)


def pieces(gap: int) -> Volume:
    mask = np.zeros(SHAPE, np.float32)
    mask[4:8, 4:12, 4:12] = mask[8 + gap : 20, 4:12, 4:12] = 1
    return Volume(mask, AFFINE)


def test_a_bone_in_two_pieces_is_refused() -> None:
    with pytest.raises(InputError, match=r"near: lies in several pieces: .* are 2\.4 mm from the rest"):
        labelled_surface(pieces(2), "a.nii.gz", "near")
    joined = labelled_surface(
        pieces(2), "a.nii.gz", "near", apart=3.0
    )  # marrow with a canal thinner than a voxel
    assert np.ptp(joined.vertices[:, 0]) > 0.8 * 15


def test_stray_voxels_are_left_out(caplog) -> None:
    mask = pieces(0)
    mask.values[1, 1, 1] = 1
    surface = labelled_surface(mask, "a.nii.gz", "near")
    assert "near in a.nii.gz: 1 stray voxels are left out" in caplog.text
    assert surface.vertices[:, 0].min() > 0.8 * 3


def test_a_map_in_another_frame_is_refused() -> None:
    truth = Phalanx()
    volume = truth.volume()
    mask = masked(truth.bone, 0.5)
    moved = Volume(volume.values, np.diag([-1.0, -1.0, 1.0, 1.0]) @ volume.affine)
    moved.affine[0, 3] -= 40.0
    surface = labelled_surface(mask, "a.nii.gz", "near")
    assert in_image(volume, surface, "a.nii.gz", "near") is surface
    with pytest.raises(InputError, match="near: 100 % of its surface is beyond the volume"):
        in_image(moved, surface, "a.nii.gz", "near")
