"""A new subject is written as a whole or not at all."""

import errno
from pathlib import Path

import nibabel
import numpy as np
import pytest

from handpipe.anatomy import shipped
from handpipe.cli import first_scene, new_subject


@pytest.fixture
def scans(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one volume, whose name has a blank and an umlaut, in an empty project."""
    monkeypatch.chdir(tmp_path)
    folder = Path("scans ü")
    folder.mkdir()
    values = np.arange(1000, dtype=np.int16).reshape(10, 10, 10)
    nibabel.save(nibabel.Nifti1Image(values, np.eye(4)), folder / "neutral.nii.gz")
    return folder


def written() -> set[str]:
    return {path.as_posix() for path in Path().rglob("*") if path.is_file()}


def full(*_: object, **__: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def full_at_the_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    write = first_scene.write_text
    monkeypatch.setattr(
        first_scene, "write_text", lambda path, text: full() if path.suffix == ".yaml" else write(path, text)
    )


def full_at_the_template(monkeypatch: pytest.MonkeyPatch) -> None:
    def install(folder: Path, *_: object, **__: object) -> None:
        folder.mkdir(exist_ok=True)
        (folder / "half.ply").write_text("ply", encoding="utf-8")
        full()

    monkeypatch.setattr(shipped, "install", install)


@pytest.mark.parametrize("fail", [full_at_the_scene, full_at_the_template])
def test_a_full_disk_leaves_nothing_and_the_command_can_be_repeated(scans: Path, fail) -> None:
    before = written()
    with pytest.MonkeyPatch.context() as broken:
        fail(broken)
        with pytest.raises(OSError, match="No space left"):
            new_subject.init("mine", scans, "right")
    assert written() == before
    path, _ = new_subject.init("mine", scans, "right")
    assert path.is_file() and all(file.is_file() for file in first_scene.scene_files("mine"))


def test_files_of_an_earlier_template_stay(scans: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = scans / new_subject.TEMPLATE / "own.ply"
    own.parent.mkdir()
    own.write_text("ply", encoding="utf-8")
    full_at_the_template(monkeypatch)
    with pytest.raises(OSError, match="No space left"):
        new_subject.init("mine", scans, "right")
    assert own.is_file()
