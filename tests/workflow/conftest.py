"""The small subject in a working copy, once for each test that breaks something in it."""

from pathlib import Path

import pytest

from .running import run, working_copy
from .small_subject import write_subject


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A working copy with the subject "small", nothing built."""
    folder = working_copy(tmp_path / "copy")
    write_subject(folder)
    return folder


@pytest.fixture(scope="session")
def built_small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A working copy where the small subject's `segmentation` is built; change only copies of it."""
    folder = working_copy(tmp_path_factory.mktemp("built") / "copy")
    write_subject(folder)
    process = run(folder, "-j2", "segmentation", "--config", "subjects=[small]")
    assert process.returncode == 0, process.stdout
    return folder
