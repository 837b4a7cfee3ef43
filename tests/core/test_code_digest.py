"""The digest of a script changes with the code that it runs, and with nothing else."""

import re
from pathlib import Path

import pytest

from handpipe.core.code_digest import CodeDigests

CHECKOUT = Path(__file__).parents[2]
FILES = {
    "pack/__init__.py": "",
    "pack/used.py": '"""Used."""\n\ndef one() -> int:\n    """One."""\n    return 1\n',
    "pack/deep.py": "VALUE = 3\n",
    "pack/started.py": "print('in a process of its own')\n",
    "pack/other.py": "OTHER = 1\n",
    "pack/inner/__init__.py": "FIRST = 1\n",
    "pack/inner/lazy.py": "from pack import deep\nfrom pack.room import asked\n",
    "pack/room/__init__.py": "from typing import TYPE_CHECKING\n\nif TYPE_CHECKING:\n"
    "    from pack.room.behind import asked\n    from pack.room.unasked import not_asked\n"
    "else:\n    from pack.faces import face\n\n    __getattr__ = face(__name__)\n\n"
    "__all__ = ['asked', 'not_asked']\n",
    "pack/faces.py": "def face(package): return None\n",
    "pack/room/behind.py": "from pack.room import below\nasked = below.VALUE\n",
    "pack/room/below.py": "VALUE = 4\n",
    "pack/room/unasked.py": "not_asked = 5\n",
    "pack/page.jinja": "<p>",
    "scripts/script.py": "from beside import x\nfrom pack.used import one\n\n\ndef f():\n"
    "    import pack.inner.lazy\n    return ['python', '-m', 'pack.started']\n",
    "scripts/beside.py": "x = 1\n",
    "scripts/stranger.py": "x = 1\n",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def digest(folder: Path, cache: Path | None = None) -> str:
    digests = CodeDigests((folder / "pack",), cache)
    found = digests.digest(folder / "scripts" / "script.py")
    digests.save()
    return found


@pytest.mark.parametrize(
    "name",
    [
        "scripts/script.py",
        "scripts/beside.py",
        "pack/used.py",
        "pack/inner/__init__.py",
        "pack/inner/lazy.py",
        "pack/deep.py",
        "pack/room/__init__.py",
        "pack/faces.py",
        "pack/room/behind.py",
        "pack/room/below.py",
        "pack/started.py",
        "pack/page.jinja",
    ],
)
def test_a_change_of_what_runs_changes_the_digest(folder: Path, name: str) -> None:
    before, cache = digest(folder, folder / "cache.json"), folder / "cache.json"
    with open(folder / name, "a") as file:
        file.write("\nNEW = 2\n")
    assert digest(folder, cache) != before
    assert digest(folder, cache) == digest(folder)


@pytest.mark.parametrize("name", ["pack/other.py", "pack/room/unasked.py", "scripts/stranger.py"])
def test_a_change_of_another_module_does_not(folder: Path, name: str) -> None:
    before = digest(folder)
    (folder / name).write_text("OTHER = 2\n")
    assert digest(folder) == before


@pytest.mark.parametrize("line", ["import pack.room", "from pack import room", "from pack.room import *"])
def test_a_face_that_is_imported_as_a_whole_is_all_that_it_exports(folder: Path, line: str) -> None:
    (folder / "pack/deep.py").write_text(f"{line}\n")
    before = digest(folder)
    (folder / "pack/room/unasked.py").write_text("not_asked = 6\n")
    assert digest(folder) != before


def test_a_package_that_is_named_in_text_is_what_runs_of_it(folder: Path) -> None:
    (folder / "pack/deep.py").write_text("['python', '-m', 'pack.room']\n")
    (folder / "pack/room/__main__.py").write_text("RUN = 6\n")
    before = digest(folder)
    (folder / "pack/room/unasked.py").write_text("not_asked = 6\n")
    assert digest(folder) == before
    (folder / "pack/room/__main__.py").write_text("RUN = 7\n")
    assert digest(folder) != before


def test_a_name_that_a_face_takes_from_another_module_changes_the_digest(folder: Path) -> None:
    before, face = digest(folder), folder / "pack/room/__init__.py"
    face.write_text(
        face.read_text().replace("pack.room.behind import asked", "pack.room.unasked import asked")
    )
    assert digest(folder) != before


def test_a_further_name_of_a_face_does_not_change_the_digest(folder: Path) -> None:
    before, face = digest(folder), folder / "pack/room/__init__.py"
    text = face.read_text().replace("import not_asked", "import further, not_asked")
    face.write_text(text.replace("['asked'", "['asked', 'further'"))
    assert digest(folder) == before


def test_words_and_layout_do_not_count(folder: Path) -> None:
    before = digest(folder)
    (folder / "pack/used.py").write_text("# why\ndef one(\n) -> int:\n    '''The first.'''\n    return 1\n")
    assert digest(folder) == before


def test_the_same_code_elsewhere_has_the_same_digest(folder: Path, tmp_path_factory) -> None:
    other = tmp_path_factory.mktemp("other")
    for name, text in FILES.items():
        (other / name).parent.mkdir(parents=True, exist_ok=True)
        (other / name).write_text(text)
    assert digest(other) == digest(folder)


def test_a_damaged_cache_is_read_as_none(folder: Path) -> None:
    (folder / "cache.json").write_text("{")
    assert digest(folder, folder / "cache.json") == digest(folder)


def test_modules_that_are_imported_by_a_made_up_name_are_known() -> None:
    """A digest does not see them: rules name them (`code_of`, `layer_code`), faces list them."""
    found = {
        path.relative_to(CHECKOUT).as_posix()
        for path in (CHECKOUT / "src").rglob("*.py")
        if re.search(r"import_module\((?!\")", path.read_text(encoding="utf-8"))
    }
    assert found == {
        "src/handpipe/core/faces.py",
        "src/handpipe/hand/layer_loading.py",
        "src/handpipe/synthetic/generators.py",
    }
