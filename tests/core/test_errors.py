"""No foreign error reaches a person: one line in plain words, and nothing half-written."""

import os
import re
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from handpipe.core import artifacts
from handpipe.core.command import reported
from handpipe.core.errors import ConvergenceError, InputError, plain

SCRIPTS = Path(__file__).parents[2] / "workflow" / "scripts"


def raised(statement: str) -> BaseException:
    """What a statement raises, with the errors that it arose from."""
    try:
        exec(statement, {"np": np, "zlib": zlib, "os": os})
    except BaseException as error:
        return error
    raise AssertionError("nothing was raised")


HDF5 = "RuntimeError(\"Can't decrement id (write failed: errno = 28, error message = 'No space left')\")"


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        ("raise OSError(28, 'No space left on device')", "no space left on the disk"),
        (f"raise {HDF5}", "no space left on the disk"),
        (f"try:\n  raise {HDF5}\nexcept RuntimeError as e:\n  raise KeyError('x') from e", "no space left"),
        ("raise PermissionError(13, 'Permission denied')", "Check its permissions"),
        ("raise PermissionError(13, 'no', 'a/ü b.h5')", "Check its permissions. The path is a/ü b.h5"),
        ("raise PermissionError(1, 'no', b'x.h5')", "Check its permissions. The path is x.h5"),
        ("raise OSError(30, 'no', '.tmp', None, 'results/a.h5')", "The path is results/a.h5"),
        ("raise OSError(30, 'Read-only file system')", "Build in a folder that you may write to"),
        ("np.zeros(2**50)", "not enough memory"),
        ("np.linalg.inv(np.zeros((2, 2)))", "unexpected LinAlgError: Singular matrix"),
        ("zlib.decompress(b'x')", "unexpected error: Error -5"),
        ("{}['bone\\nx']", "unexpected KeyError: 'bone"),
        ("raise ValueError", "unexpected ValueError"),
    ],
)
def test_foreign_errors_are_one_plain_line(statement: str, said: str) -> None:
    line = plain(raised(statement))
    assert said in line and "\n" not in line and "Traceback" not in line


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        ("raise OSError(28, 'no', 'out/a.obj')", "no space left on the disk. Free some .* is out/a.obj"),
        (f"raise {HDF5}", "no space left on the disk. Free some"),
        ("raise PermissionError(13, 'no', 'out')", "may not be accessed. Check .* is out"),
        ("open('no such folder/a.obj')", "no such folder/a.obj: No such file"),
        ("np.linalg.inv(np.zeros((2, 2)))", "unexpected LinAlgError: Singular matrix. The log is "),
    ],
)
def test_a_command_ends_with_one_line_that_says_what_to_do(
    statement: str,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with reported() as failure:
        exec(statement, {"np": np})
    [line] = capsys.readouterr().err.splitlines()
    assert failure.code == 1 and re.match(f"handpipe: .*{said}", line)


def test_an_unexpected_error_is_said_where_no_log_can_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    with reported() as failure:
        raise KeyError("bone")
    [line] = capsys.readouterr().err.splitlines()
    assert failure.code == 1 and "unexpected KeyError: 'bone'. No log was written: No such file" in line


def test_errors_for_people_stay_as_they_are() -> None:
    error = InputError("a.csv", "row 2", "is\nempty", "Fill it")
    assert plain(error) == "a.csv: row 2: is empty. Fill it"


def test_the_remedy_of_a_part_is_said_once() -> None:
    error = ConvergenceError("The rod", "no step decreases its energy").within("Tendon x").within("The hand")
    assert str(error) == (
        "The hand did not converge: tendon x: the rod: no step decreases its energy. "
        "See the log for its residuals."
    )


SCRIPT = """
import sys
import tempfile
from types import SimpleNamespace
sys.path.insert(0, sys.argv[1])
from common import stage
with stage(SimpleNamespace(log=[sys.argv[2]], rule="some_rule", input=[], params=dict())):
    import numpy as np
    from handpipe.core import artifacts
    {}
"""


def run_script(log: Path, body: str) -> subprocess.CompletedProcess[str]:
    code = SCRIPT.format(body.replace("\n", "\n    "))
    arguments = [sys.executable, "-c", code, str(SCRIPTS), str(log)]
    return subprocess.run(arguments, capture_output=True, text=True, check=False)


def test_an_unexpected_error_of_a_stage_is_one_line_and_its_traceback_is_in_the_log(tmp_path: Path) -> None:
    log = tmp_path / "rule.log"
    process = run_script(log, "np.linalg.inv(np.zeros((2, 2)))")
    assert (process.returncode, process.stdout) == (1, "")
    [line] = process.stderr.splitlines()
    assert line.startswith("handpipe: some_rule: unexpected LinAlgError: Singular matrix")
    assert line.endswith(f"See {log}")
    assert "Traceback (most recent call last)" in log.read_text(encoding="utf-8")


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A folder on a disk of 3 MB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", str(folder)]
    try:
        made = subprocess.run(mount, capture_output=True, check=False).returncode == 0
    except OSError:
        made = False
    if not made:
        pytest.skip("mounting a small disk needs root")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.parametrize(
    "body",
    [
        "artifacts.write('{0}/a.h5', {{'x': np.random.default_rng(0).random((900, 900))}}, kind='t')",
        "values = {{f'x{{i}}': np.random.default_rng(i).random(900) for i in range(700)}}\n"
        "artifacts.write('{0}/a.h5', values, kind='t')",
        "artifacts.write_text('{0}/a.txt', 'x' * 5_000_000)",
        "import nibabel\n"
        "with artifacts.atomic('{0}/a.nii.gz') as file:\n"
        "    image = np.random.default_rng(0).random((99, 99, 99))\n"
        "    nibabel.save(nibabel.Nifti1Image(image, np.eye(4)), file)",
    ],
    ids=["one array", "many arrays", "text", "image"],
)
def test_a_full_disk_is_said_in_one_line_and_leaves_no_file(
    small_disk: Path, tmp_path: Path, body: str
) -> None:
    artifacts.write_text(small_disk / "before.txt", "kept")
    process = run_script(small_disk / "rule.log", body.format(small_disk))
    assert process.returncode == 1
    [line] = process.stderr.splitlines()
    assert line.startswith("handpipe: some_rule: no space left on the disk")
    assert sorted(p.name for p in small_disk.iterdir()) == ["before.txt", "rule.log"]
