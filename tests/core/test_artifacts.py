"""Artifacts keep what they are given, or nothing at all."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from handpipe.core import artifacts
from handpipe.core.errors import InputError


def test_round_trip_keeps_arrays_units_and_provenance(tmp_path):
    source = tmp_path / "in.txt"
    source.write_text("data")
    data = {
        "points": np.arange(6.0).reshape(2, 3),
        "part": {"ids": np.array([1, 2]), "names": ["a", "b"]},
        "n": 3,
    }
    path = tmp_path / "deep" / "x.h5"
    artifacts.write(path, data, kind="thing", units={"points": "mm"}, inputs=[source])
    back = artifacts.read(path, "thing")
    np.testing.assert_array_equal(back["points"], data["points"])
    assert list(back["part"]["names"]) == ["a", "b"] and back["n"] == 3
    with h5py.File(path) as file:
        assert file["points"].attrs["units"] == "mm"
    assert artifacts.content_hash(source) in artifacts.read_attributes(path)["inputs"]


def test_same_data_gives_the_same_bytes(tmp_path):
    for name in ("a/x.h5", "b/x.h5"):
        artifacts.write(tmp_path / name, {"x": np.random.default_rng(0).random((500, 3))}, kind="thing")
    assert (tmp_path / "a/x.h5").read_bytes() == (tmp_path / "b/x.h5").read_bytes()


def test_failed_write_leaves_the_old_file_and_no_half_one(tmp_path):
    path = tmp_path / "x.h5"
    artifacts.write(path, {"x": 1}, kind="thing")
    before = path.read_bytes()
    with pytest.raises(TypeError):
        artifacts.write(path, {"x": np.zeros(3), "bad": np.array([object()])}, kind="thing")
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


def test_truncated_file_is_named(tmp_path):
    path = tmp_path / "x.h5"
    artifacts.write(path, {"x": np.random.default_rng(0).random(5000)}, kind="thing")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match=r"x\.h5: content: cannot be read as HDF5.*Delete the file"):
        artifacts.read(path, "thing")


@pytest.mark.parametrize(("kind", "field"), [("other", "kind"), ("thing", "file")])
def test_wrong_kind_and_missing_file_are_named(tmp_path, kind, field):
    path = tmp_path / "x.h5"
    if field == "kind":
        artifacts.write(path, {"x": 1}, kind="thing")
    with pytest.raises(InputError, match=f"x.h5: {field}:"):
        artifacts.read(path, kind)


def test_leftovers_of_a_killed_writer_are_removed(tmp_path):
    mine, other = tmp_path / ".4711.x.h5", tmp_path / ".4711.y.h5"
    for path in (mine, other):
        path.write_bytes(b"half")
    artifacts.write(tmp_path / "x.h5", {"n": 3}, kind="test")
    assert sorted(p.name for p in tmp_path.iterdir()) == [other.name, "x.h5"]


def test_every_kind_of_value_is_read_as_it_was_written(tmp_path):
    """The hash of what is read is that of what was written, whatever the type."""
    data = {
        "flags": np.array([True, False]),
        "narrow": np.arange(5, dtype=np.int16).reshape(5, 1)[::2],
        "single": np.float32(0.1),
        "empty": np.zeros((0, 3)),
        "text": "Fl\u00fcgel",
        "texts": [["a", "b"], ["", "c"]],
        "none": [],
        "deep/er": {"x": 1},
        "deep": {"y": -0.0},
    }
    artifacts.write(tmp_path / "x.h5", data, kind="thing")
    back = artifacts.read(tmp_path / "x.h5", "thing")
    assert back["text"] == "Fl\u00fcgel"
    assert back["deep"].keys() == {"er", "y"}


def test_a_changed_value_is_named(tmp_path):
    path = tmp_path / "x.h5"
    artifacts.write(path, {"x": np.arange(5.0), "names": ["a", "b"]}, kind="thing")
    with h5py.File(path, "r+") as file:
        file["x"][3] += 1e-12
    with pytest.raises(InputError, match=r"x\.h5: content: is not what was written"):
        artifacts.read(path, "thing")


def test_artifacts_record_rule_parameters_and_commit(tmp_path):
    with artifacts.made_by("fit_rig", {"edge": "1.5"}):
        artifacts.write(tmp_path / "x.h5", {"x": 1}, kind="thing")
    found = artifacts.read_attributes(tmp_path / "x.h5")
    assert found["rule"] == "fit_rig"
    assert json.loads(found["parameters"]) == {"edge": "1.5"}
    assert found["commit"] == artifacts.commit()
    assert re.fullmatch("([0-9a-f]{40}(-dirty)?)?", artifacts.commit())


@pytest.fixture
def chain(tmp_path, monkeypatch):
    """Two artifacts, and a third one that is made of them and a scan."""
    monkeypatch.chdir(tmp_path)
    Path("scan.ply").write_text("scan")
    for name in ("one", "two"):
        artifacts.write(f"{name}.h5", {"name": name}, kind="part")
    artifacts.write("whole.h5", {"x": 1}, kind="whole", inputs=["one.h5", "two.h5", "scan.ply"])
    return ["one.h5", "two.h5", "whole.h5", tmp_path / "scan.ply", "absent.nii.gz"]


def test_inputs_that_belong_together_pass(chain):
    artifacts.check_inputs(chain)


def exchanged():
    shutil.copy("one.h5", "two.h5")
    return r"two\.h5: path: is the artifact one\.h5"


def rebuilt_differently():
    artifacts.write("two.h5", {"name": "three"}, kind="part")
    return r"two\.h5: content: is not the file that whole\.h5 was made of"


def rebuilt_by_other_code():
    """The same data with another commit: what was made of it is still right."""
    with artifacts.made_by("part", {"code": "other"}):
        artifacts.write("two.h5", {"name": "two"}, kind="part")


def test_the_same_data_from_other_code_belongs_together(chain):
    before = Path("two.h5").read_bytes()
    rebuilt_by_other_code()
    assert Path("two.h5").read_bytes() != before
    artifacts.check_inputs(chain)


def another_scan():
    Path("scan.ply").write_text("nacs")
    return r"scan\.ply: content: is not the file that whole\.h5 was made of"


def truncated():
    Path("whole.h5").write_bytes(Path("whole.h5").read_bytes()[:300])
    return r"whole\.h5: content: cannot be read as HDF5"


@pytest.mark.parametrize("spoil", [exchanged, rebuilt_differently, another_scan, truncated])
def test_inputs_that_do_not_are_named(chain, spoil):
    message = spoil()
    with pytest.raises(InputError, match=message):
        artifacts.check_inputs(chain)


def test_file_and_folder_are_on_the_disk_before_and_after_the_renaming(tmp_path, monkeypatch):
    """Power may fail at any time: the content first, then the name."""
    done, open_, fsync, replace = [], os.open, os.fsync, os.replace
    names = {}

    def opened(path, *arguments):
        descriptor = open_(path, *arguments)
        names[descriptor] = Path(path).name
        return descriptor

    monkeypatch.setattr(os, "open", opened)
    monkeypatch.setattr(os, "fsync", lambda d: (done.append(("fsync", names[d])), fsync(d)))
    monkeypatch.setattr(os, "replace", lambda a, b: (done.append(("replace", Path(b).name)), replace(a, b)))
    artifacts.write_text(tmp_path / "x.json", "{}")
    [(first, temporary), *rest] = done
    assert first == "fsync" and temporary.endswith(".x.json") and temporary != "x.json"
    assert rest == [("replace", "x.json"), ("fsync", tmp_path.name)]


def test_a_full_disk_is_an_error_of_the_system_and_leaves_nothing(tmp_path):
    """In a process with little room for files, as on a full disk; HDF5 itself would crash at its exit."""
    code = (
        "import errno, resource, signal, sys\n"
        "import numpy as np\n"
        "from handpipe.core import artifacts\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))\n"
        "try:\n"
        "    artifacts.write(sys.argv[1], {'x': np.random.default_rng(0).random(10**5)}, kind='thing')\n"
        "except OSError as error:\n"
        "    print(error.errno == errno.EFBIG)\n"
    )
    process = subprocess.run(
        [sys.executable, "-c", code, tmp_path / "x.h5"], capture_output=True, text=True, check=False
    )
    assert (process.returncode, process.stdout.strip(), process.stderr) == (0, "True", "")
    assert list(tmp_path.iterdir()) == []
