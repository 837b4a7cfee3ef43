"""Compiled kernels follow the code of all files that they are made of."""

import os
import subprocess
import sys

import pytest

CALLER = "from numba import njit\nfrom package.called import shifted\n\n\n@njit(cache=True)\ndef twice(x):\n"
CALLER += "    return 2 * shifted(x)\n\n\nprint(twice(1))\n"
CALLED = "from numba import njit\n\n\n@njit(cache=True)\ndef shifted(x):\n    return x + {}\n"
APART = "from pathlib import Path\n\nfrom handpipe import keep_kernels_apart\n\n"
APART += "keep_kernels_apart(Path(__file__).parent)\n"


@pytest.fixture
def package(tmp_path):
    folder = tmp_path / "package"
    folder.mkdir()
    (folder / "__init__.py").write_text(APART)
    (folder / "caller.py").write_text(CALLER)
    return folder


def printed(package, **environment):
    inherited = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | environment
    command = [sys.executable, "-c", "import package.caller"]
    done = subprocess.run(
        command, cwd=package.parent, env=inherited, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def compiled(package):
    return sorted(path for path in package.rglob("*.nbi"))


def test_a_kernel_follows_a_change_of_what_it_calls_in_another_file(package):
    (package / "called.py").write_text(CALLED.format(1))
    assert printed(package) == "4"
    before = compiled(package)
    (package / "called.py").write_text(CALLED.format(10))
    assert printed(package) == "22"
    assert before and not set(before) & set(compiled(package))


def test_kernels_are_kept_while_no_kernel_changes(package):
    (package / "called.py").write_text(CALLED.format(1))
    printed(package)
    before = {path: path.stat().st_mtime_ns for path in compiled(package)}
    (package / "plain.py").write_text("X = 1\n")
    assert printed(package) == "4"
    assert before == {path: path.stat().st_mtime_ns for path in compiled(package)} != {}


def test_a_folder_that_a_person_chose_is_used(package, tmp_path):
    (package / "called.py").write_text(CALLED.format(1))
    printed(package, NUMBA_CACHE_DIR=str(tmp_path / "mine"))
    assert list((tmp_path / "mine").rglob("*.nbi")) and not compiled(package)
