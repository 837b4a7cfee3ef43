"""Artifact with its provenance.

Stages write HDF5 files with nested arrays, units, the hashes of their inputs and the commit. Reading checks
the kind and the hash of the data: a changed file is an error, not a wrong result.
"""

import tempfile
from pathlib import Path

import h5py
import numpy as np

from handpipe.core import InputError, artifacts

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "rig.h5"
    axes = np.eye(3)
    artifacts.write(path, {"joints": {"axes": axes}}, kind="rig", units={"joints": "1"})
    print("kind:", artifacts.read_attributes(path)["kind"])
    assert np.array_equal(artifacts.read(path, "rig")["joints"]["axes"], axes)

    with h5py.File(path, "r+") as file:
        file["joints/axes"][0, 0] = 2.0
    try:
        artifacts.read(path, "rig")
    except InputError as error:
        print("refused:", error.problem)
    else:
        raise AssertionError("the change was not noticed")
