"""The digest of a script changes with the code that it runs, and with nothing else."""

import re
from pathlib import Path

import pytest

from handpipe.code_digest import CodeDigests

CHECKOUT = Path(__file__).parents[1]
FILES = {
    "pack/__init__.py": "",
    "pack/used.py": '"""Used."""\n\ndef one() -> int:\n    """One."""\n    return 1\n',
    "pack/deep.py": "VALUE = 3\n",
    "pack/started.py": "print('in a process of its own')\n",
    "pack/other.py": "OTHER = 1\n",
    "pack/inner/__init__.py": "FIRST = 1\n",
    "pack/inner/lazy.py": "from pack import deep\n",
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
    found = digests.of(folder / "scripts" / "script.py")
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


@pytest.mark.parametrize("name", ["pack/other.py", "scripts/stranger.py"])
def test_a_change_of_another_module_does_not(folder: Path, name: str) -> None:
    before = digest(folder)
    (folder / name).write_text("OTHER = 2\n")
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
    """A digest does not see them: rules name them (`generator_file`, `layer_code`)."""
    found = {
        path.relative_to(CHECKOUT).as_posix()
        for path in (CHECKOUT / "src").rglob("*.py")
        if re.search(r"import_module\((?!\")", path.read_text(encoding="utf-8"))
    }
    assert found == {"src/handpipe/datasets/generators.py", "src/handpipe/hand/layer_loading.py"}
