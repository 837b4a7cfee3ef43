"""A face passes on names of the modules behind it, each loaded when its name is first asked for."""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from handpipe.core.faces import exports

FILES = {
    "room_of_test/__init__.py": "from typing import TYPE_CHECKING\n\nfrom handpipe.core.faces import face\n\n"
    "if TYPE_CHECKING:\n    from room_of_test import whole\n"
    "    from room_of_test.behind import Asked, asked\n"
    "else:\n    __getattr__ = face(__name__)\n\n__all__ = ['Asked', 'asked', 'whole']\n",
    "room_of_test/behind.py": "class Asked: pass\n\n\ndef asked(): return 1\n",
    "room_of_test/whole.py": "VALUE = 2\n",
    "room_of_test/unasked.py": "VALUE = 3\n",
}


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    yield tmp_path / "room_of_test"
    for name in [name for name in sys.modules if name.startswith("room_of_test")]:
        del sys.modules[name]


def test_a_name_is_that_of_its_module(room: Path) -> None:
    face = importlib.import_module("room_of_test")
    assert "room_of_test.behind" not in sys.modules
    assert face.asked() == 1
    behind = sys.modules["room_of_test.behind"]
    assert face.asked is behind.asked
    assert face.Asked is behind.Asked


def test_a_module_that_is_exported_is_the_module(room: Path) -> None:
    face = importlib.import_module("room_of_test")
    assert face.whole.VALUE == 2
    assert face.whole is sys.modules["room_of_test.whole"]


@pytest.mark.parametrize("name", ["missing", "unasked"])
def test_what_a_face_does_not_export_is_no_attribute(room: Path, name: str) -> None:
    face = importlib.import_module("room_of_test")
    with pytest.raises(AttributeError, match=f"'room_of_test' has no attribute '{name}'"):
        getattr(face, name)
    assert not hasattr(face, name)


def test_exports_are_listed_with_their_modules(room: Path) -> None:
    assert exports(room / "__init__.py") == {
        "Asked": "room_of_test.behind",
        "asked": "room_of_test.behind",
        "whole": "room_of_test",
    }
