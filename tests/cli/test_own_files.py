"""A folder that is written to again holds what the last run wrote, and nobody else's file is touched."""

from pathlib import Path

import pytest

from handpipe.cli.own_files import LISTED, written_anew
from handpipe.core import InputError


def write(folder: Path, owner: str, files: dict[str, str]) -> None:
    with written_anew(folder, owner) as made:
        for name, text in files.items():
            (made / name).parent.mkdir(parents=True, exist_ok=True)
            (made / name).write_text(text, encoding="utf-8")


def contents(folder: Path) -> dict[str, str]:
    return {
        p.relative_to(folder).as_posix(): p.read_text(encoding="utf-8")
        for p in folder.rglob("*")
        if p.is_file() and p.name != LISTED
    }


def test_what_is_not_written_again_goes_and_what_others_put_there_stays(tmp_path: Path) -> None:
    folder = tmp_path / "Hände, neu"
    write(folder, "one", {"page.html": "old", "wave.glb": "old", "model/a.stl": "old", "notes.csv": "old"})
    (folder / "mine.txt").write_text("mine", encoding="utf-8")
    (folder / "notes.csv").write_text("annotated by a person", encoding="utf-8")
    write(folder, "two", {"other.csv": "other"})
    write(folder, "one", {"page.html": "new"})
    found = {
        "page.html": "new",
        "mine.txt": "mine",
        "notes.csv": "annotated by a person",
        "other.csv": "other",
    }
    assert contents(folder) == found
    assert sorted(p.name for p in folder.iterdir() if p.is_dir()) == []


def test_a_file_of_another_owner_is_not_replaced(tmp_path: Path) -> None:
    write(tmp_path / "out", "one", {"close.glb": "of one"})
    with pytest.raises(InputError, match="close.glb: file: was written by one, and two writes"):
        write(tmp_path / "out", "two", {"close.glb": "of two", "two.csv": ""})
    assert contents(tmp_path / "out") == {"close.glb": "of one"}


def test_a_failed_run_leaves_everything_as_it_was(tmp_path: Path) -> None:
    write(tmp_path / "out", "one", {"a": "old", "b": "old"})
    with pytest.raises(RuntimeError), written_anew(tmp_path / "out", "one") as made:
        (made / "a").write_text("half", encoding="utf-8")
        raise RuntimeError
    with pytest.raises(RuntimeError), written_anew(tmp_path / "new", "one") as made:
        raise RuntimeError
    assert contents(tmp_path / "out") == {"a": "old", "b": "old"}
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("text", ["{", "[]", '{"one": 3}', '{"one": {"../outside": "1"}}'])
def test_a_damaged_list_is_refused_and_removes_nothing(tmp_path: Path, text: str) -> None:
    (tmp_path / "outside").write_text("1", encoding="utf-8")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / LISTED).write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="is no list of files"):
        write(tmp_path / "out", "one", {"a": "new"})
    assert (tmp_path / "outside").is_file() and contents(tmp_path / "out") == {}
