"""Artifacts keep what they are given, or nothing at all."""

import h5py
import numpy as np
import pytest

from handpipe import artifacts
from handpipe.errors import InputError


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
    for name in ("a.h5", "b.h5"):
        artifacts.write(tmp_path / name, {"x": np.random.default_rng(0).random((500, 3))}, kind="thing")
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


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
