"""Two results folders are compared by their arrays."""

import json
from pathlib import Path

import meshio
import nibabel as nib
import numpy as np
import pytest

from handpipe.core import artifacts
from handpipe.develop.compare import compare_folders, main

NUMBERS = np.arange(12.0).reshape(4, 3)


def made(folder: Path, numbers: np.ndarray = NUMBERS, seconds: float = 1.0, error: float = 0.5) -> Path:
    """A small results folder with one file of each format."""
    subject = folder / "toy"
    (subject / "logs").mkdir(parents=True)
    artifacts.write(subject / "rig.h5", {"axes": numbers, "names": ["a", "b"]}, kind="rig")
    metrics = {"seconds": {"value": seconds, "unit": "s"}, "error": {"value": error, "unit": "mm"}}
    (subject / "metrics.json").write_text(json.dumps(metrics))
    image = nib.Nifti1Image(np.round(numbers)[None].astype(np.float32), np.eye(4))
    nib.save(image, subject / "labels.nii.gz")
    meshio.write_points_cells(subject / "skin.vtu", numbers, [("triangle", np.array([[0, 1, 2]]))])
    (subject / "logs" / "rig.log").write_text(f"{seconds} s")
    return folder


def found(first: Path, second: Path, tolerance: float = 0.0) -> dict[tuple[str, str], str]:
    return {(d.path, d.array): d.what for d in compare_folders(first, second, tolerance)}


def test_times_and_logs_do_not_count(tmp_path: Path) -> None:
    first, second = made(tmp_path / "a", seconds=1.0), made(tmp_path / "b", seconds=2.0)
    assert found(first, second) == {}
    assert main([str(first), str(second)]) == 0


def test_the_last_bit_counts(tmp_path: Path) -> None:
    changed = NUMBERS.copy()
    changed[1, 2] = np.nextafter(5.0, 6.0)
    first, second = made(tmp_path / "a"), made(tmp_path / "b", changed)
    differences = found(first, second)
    assert set(differences) == {("toy/rig.h5", "axes"), ("toy/skin.vtu", "points")}
    assert differences["toy/rig.h5", "axes"] == f"1 of 12 numbers differ, by up to {np.spacing(5.0):.3g}"
    assert main([str(first), str(second)]) == 1


def test_tolerance_is_in_the_units_of_the_array(tmp_path: Path) -> None:
    first, second = made(tmp_path / "a"), made(tmp_path / "b", NUMBERS + 1e-7, error=0.75)
    assert set(found(first, second, 1e-6)) == {("toy/metrics.json", "error/value")}
    assert found(first, second, 0.3) == {}


def test_what_is_missing_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = made(tmp_path / "a"), made(tmp_path / "b")
    (second / "toy" / "rig.h5").unlink()
    assert main([str(first), str(second)]) == 1
    assert f"toy/rig.h5: missing in {second}" in capsys.readouterr().out


def test_arrays_of_other_shape_type_or_name_differ(tmp_path: Path) -> None:
    for folder, data in (
        ("a", {"shape": np.zeros(3), "type": np.zeros(3), "one": np.zeros(1), "nan": [np.nan]}),
        ("b", {"shape": np.zeros(4), "type": np.zeros(3, np.float32), "other": np.zeros(1), "nan": [np.nan]}),
        ("c", {"shape": np.zeros(3), "type": np.zeros(3), "one": np.zeros(1), "nan": [0.0]}),
    ):
        artifacts.write(tmp_path / folder / "x.h5", data, kind="toy")
    assert {array for _, array in found(tmp_path / "a", tmp_path / "b")} == {"shape", "type", "one", "other"}
    assert {array for _, array in found(tmp_path / "a", tmp_path / "c", 1e9)} == {"nan"}


def test_an_empty_folder_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(SystemExit) as stopped:
        main([str(made(tmp_path / "a")), str(tmp_path / "empty")])
    assert stopped.value.code == 2


@pytest.mark.parametrize("tolerance", ["nan", "-1", "inf"])
def test_a_tolerance_that_is_no_length_is_refused(tmp_path: Path, tolerance: str) -> None:
    """No number is larger than NaN: everything would count as equal."""
    folders = [str(made(tmp_path / name)) for name in ("a", "b")]
    with pytest.raises(SystemExit) as ended:
        main([*folders, f"--tolerance={tolerance}"])
    assert ended.value.code == 2


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = made(tmp_path / "a"), made(tmp_path / "b")
    file = next(first.rglob("*.h5"))
    file.write_bytes(b"no HDF5")
    assert main([str(first), str(second)]) == 1
    assert capsys.readouterr().err.startswith("handpipe: ")
