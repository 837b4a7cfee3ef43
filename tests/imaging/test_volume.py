import tracemalloc
from itertools import permutations, product
from pathlib import Path

import nibabel
import nrrd
import numpy as np
import pytest
import SimpleITK as sitk
from benchmarks.trust import volume_rows
from benchmarks.trust.nifti_rows import declared
from nibabel.orientations import axcodes2ornt, inv_ornt_aff, io_orientation, ornt_transform

from handpipe.core.errors import InputError
from handpipe.imaging.volumes.volume import (
    Volume,
    read_label_table,
    read_labels,
    read_volume,
    write_labels,
    write_volume,
)

FOOT = Path(__file__).parents[3] / "shared" / "data" / "real_mri" / "foot_dixon"


def oblique_affine() -> np.ndarray:
    angle = 0.3
    rotation = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    affine = np.eye(4)
    affine[:3, :3] = rotation * [0.5, 0.6, 0.8]
    affine[:3, 3] = [-12, 7, 30]
    return affine


@pytest.fixture
def volume() -> Volume:
    random = np.random.default_rng(0)
    return Volume(random.integers(0, 900, (9, 8, 7)).astype(np.float32), oblique_affine())


def linear_field() -> tuple[Volume, np.ndarray]:
    slope = np.array([2.0, -3.0, 0.7])
    empty = Volume(np.zeros((9, 8, 7), np.float32), oblique_affine())
    centres = empty.to_world(np.indices(empty.shape).reshape(3, -1).T)
    return empty.like((centres @ slope).reshape(empty.shape)), slope


def test_sampling_and_gradient_are_exact_for_a_linear_field() -> None:
    field, slope = linear_field()
    inside = np.random.default_rng(1).uniform(1, [7, 6, 5], (50, 3))
    points = field.to_world(inside)
    np.testing.assert_allclose(field.sample(points), points @ slope, atol=1e-4)
    np.testing.assert_allclose(field.gradient(points), np.broadcast_to(slope, (50, 3)), atol=1e-4)


def test_a_crop_samples_as_the_whole() -> None:
    field, slope = linear_field()
    part = field.crop(np.array([2, 1, 3]), np.array([7, 6, 6]))
    points = field.to_world(np.array([[3.2, 2.5, 3.9], [5.5, 4.9, 4.1]]))
    np.testing.assert_allclose(part.sample(points), points @ slope, atol=1e-4)


def test_formats_agree_in_world_space(tmp_path, volume) -> None:
    write_volume(tmp_path / "a.nii.gz", volume)
    to_lps = np.diag([-1.0, -1, 1, 1]) @ volume.affine
    header = {
        "space": "left-posterior-superior",
        "space directions": to_lps[:3, :3].T,
        "space origin": to_lps[:3, 3],
    }
    nrrd.write(str(tmp_path / "a.nrrd"), volume.values, header)
    header = {
        "space": "RAS",
        "space directions": volume.affine[:3, :3].T,
        "space origin": volume.affine[:3, 3],
    }
    nrrd.write(str(tmp_path / "b.nrrd"), volume.values, header)
    write_dicom(tmp_path / "dicom", volume.values, to_lps)
    for name in ("a.nii.gz", "a.nrrd", "b.nrrd", "dicom"):
        read = read_volume(tmp_path / name)
        np.testing.assert_array_equal(read.values, volume.values)
        np.testing.assert_allclose(read.affine, volume.affine, atol=1e-5)


def write_dicom(folder, values, affine) -> None:
    folder.mkdir()
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    direction = affine[:3, :3] / spacing
    for k in range(values.shape[2]):
        image = sitk.GetImageFromArray(values[:, :, k : k + 1].T.astype(np.uint16))
        image.SetSpacing(spacing.tolist())
        image.SetDirection(direction.ravel().tolist())
        origin = affine[:3, 3] + k * affine[:3, 2]
        image.SetOrigin(origin.tolist())
        image.SetMetaData("0020|000e", "1.2.3.4")
        image.SetMetaData("0020|000d", "1.2.3")
        image.SetMetaData("0020|0032", "\\".join(f"{c:.9g}" for c in origin))
        image.SetMetaData("0020|0037", "\\".join(f"{c:.9g}" for c in direction[:, :2].T.ravel()))
        image.SetMetaData("0020|0013", str(k))
        writer = sitk.ImageFileWriter()
        writer.KeepOriginalImageUIDOn()
        writer.SetFileName(str(folder / f"{k:03}.dcm"))
        writer.Execute(image)


ORDERS = ["".join(o) for axes in permutations(("LR", "PA", "IS")) for o in product(*axes)]


@pytest.mark.parametrize("order", ORDERS)
def test_storage_order_changes_nothing(tmp_path, volume, order) -> None:
    turn = ornt_transform(io_orientation(volume.affine), axcodes2ornt(order))
    stored = nibabel.apply_orientation(volume.values, turn)
    affine = volume.affine @ inv_ornt_aff(turn, volume.shape)
    write_nifti(tmp_path / "a.nii", stored, affine)
    read = read_volume(tmp_path / "a.nii")
    np.testing.assert_array_equal(read.values, volume.values)
    np.testing.assert_allclose(read.affine, volume.affine, atol=1e-5)
    write_nifti(tmp_path / "labels.nii", (stored > 450).astype(np.uint8), affine)
    np.testing.assert_array_equal(read_labels(tmp_path / "labels.nii", volume), volume.values > 450)


def test_labels_follow_a_volume_whose_axes_are_as_close_to_two_orders(tmp_path) -> None:
    """At 45 degrees rounding alone decides which order is closest to RAS."""
    turned = np.eye(4)
    turned[:2, :2] = np.sqrt(0.5) * np.array([[1, -1], [1, 1]])
    labels = np.random.default_rng(0).integers(0, 5, (6, 5, 4)).astype(np.uint8)
    tilts = (-1e-6, 1e-6)
    orders = set()
    for k, tilt in enumerate(tilts):
        spin = np.eye(4)
        spin[:2, :2] += [[0, -tilt], [tilt, 0]]
        write_nifti(tmp_path / f"{k}.nii", labels, spin @ turned)
        orders.add(read_volume(tmp_path / f"{k}.nii").shape)
    assert orders == {(6, 5, 4), (5, 6, 4)}  # the two are read in different orders
    for k in range(2):
        other = read_volume(tmp_path / f"{1 - k}.nii")
        np.testing.assert_array_equal(read_labels(tmp_path / f"{k}.nii", other), other.values)


@pytest.mark.skipif(not FOOT.is_dir(), reason=f"{FOOT} is not on this machine")
def test_a_real_foot_is_read_as_it_is() -> None:
    files = sorted(FOOT.glob("*.nii.gz"))
    assert len(files) == 3
    for path in files:
        image = nibabel.load(path)
        assert nibabel.aff2axcodes(image.affine) == ("A", "S", "L")  # left-handed storage
        stored, volume = np.asarray(image.dataobj), read_volume(path)
        index = np.random.default_rng(0).integers(0, stored.shape, (500, 3))
        world = nibabel.affines.apply_affine(image.affine, index)
        np.testing.assert_allclose(volume.sample(world), stored[tuple(index.T)], atol=1e-3)
        assert sorted(volume.shape) == sorted(stored.shape)
        assert np.linalg.det(volume.affine[:3, :3]) > 0


def test_files_of_every_dialect_are_read_right_or_refused() -> None:
    table = volume_rows.rows()
    assert [row for row in table if row.wrong] == []
    assert len(table) >= 150
    assert {row.format for row in table} >= {"NIfTI", "NRRD", "seg.nrrd", "MetaImage", "DICOM"}


def test_a_declared_size_is_never_allocated(tmp_path) -> None:
    path = declared(tmp_path / "a.nii.gz")
    assert path.stat().st_size < 100
    tracemalloc.start()
    with pytest.raises(InputError, match="header declares 32,000,000,000 bytes"):
        read_volume(path)
    assert tracemalloc.get_traced_memory()[1] < 1e7
    tracemalloc.stop()


def write_nifti(path, values, affine=None, unit="mm"):
    image = nibabel.Nifti1Image(values, np.eye(4) if affine is None else affine)
    image.header.set_xyzt_units(unit)
    nibabel.save(image, path)
    return path


def broken(name, folder):
    path = folder / "broken.nii.gz"
    values = np.ones((4, 4, 4), np.float32)
    if name == "nan":
        values[1, 2, 3] = np.nan
    elif name == "infinite":
        values[1, 2, 3] = np.inf
    elif name == "two_dimensional":
        return write_nifti(path, values[:, :, 0])
    elif name == "metres":
        return write_nifti(path, values, np.diag([5e-4, 5e-4, 5e-4, 1]))
    elif name == "micrometres":
        return write_nifti(path, values, np.diag([500.0, 500, 500, 1]))
    elif name == "unit_in_header":
        return write_nifti(path, values, unit="meter")
    elif name == "missing":
        return folder / "nothing.nii.gz"
    elif name == "garbage":
        path.write_bytes(b"not an image")
        return path
    elif name == "empty_folder":
        return folder
    elif name == "format":
        path = folder / "volume.txt"
        path.write_text("1 2 3")
        return path
    return write_nifti(path, values)


@pytest.mark.parametrize(
    ("name", "field"),
    [
        ("nan", "values"),
        ("infinite", "values"),
        ("two_dimensional", "shape"),
        ("metres", "units"),
        ("micrometres", "units"),
        ("unit_in_header", "units"),
        ("missing", "volume"),
        ("garbage", "content"),
        ("empty_folder", "volume"),
        ("format", "format"),
    ],
)
def test_a_bad_volume_is_named(tmp_path, name, field) -> None:
    path = broken(name, tmp_path)
    with pytest.raises(InputError) as caught:
        read_volume(path)
    assert caught.value.field == field
    assert caught.value.source == str(path)
    assert caught.value.remedy


def test_labels_and_their_table_return(tmp_path, volume) -> None:
    labels = np.random.default_rng(0).integers(0, 5, volume.shape).astype(np.uint8)
    path = tmp_path / "labels.nii.gz"
    write_labels(path, labels, volume.affine, {"metacarpal2": 1, "distal2": 4})
    np.testing.assert_array_equal(read_labels(path, volume), labels)
    assert read_label_table(path) == {"metacarpal2": 1, "distal2": 4}


def test_seeds_on_another_grid_are_refused(tmp_path, volume) -> None:
    moved = volume.affine.copy()
    moved[0, 3] += 0.1
    for name, shape, affine in (("shape", (9, 8, 6), volume.affine), ("place", volume.shape, moved)):
        path = tmp_path / f"{name}.nii.gz"
        write_labels(path, np.ones(shape, np.uint8), affine, {})
        with pytest.raises(InputError) as caught:
            read_labels(path, volume)
        assert caught.value.field == "grid"


def test_values_that_are_no_labels_are_refused(tmp_path) -> None:
    path = write_nifti(tmp_path / "a.nii.gz", np.full((3, 3, 3), 0.5, np.float32))
    with pytest.raises(InputError) as caught:
        read_labels(path)
    assert caught.value.field == "values"
