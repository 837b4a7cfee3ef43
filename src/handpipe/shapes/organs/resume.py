"""Interrupted fits continue from their last step."""

from __future__ import annotations

import hashlib
import logging
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from handpipe import __version__
from handpipe.core import InputError, artifacts
from handpipe.mesh.tets import TetMesh
from handpipe.shapes.observations.attached import Attached
from handpipe.shapes.optimisation.search import StepRecord
from handpipe.shapes.optimisation.strain_space import State
from handpipe.shapes.organs.remeshing import Given, OnMesh
from handpipe.shapes.organs.stages import FitPosition
from handpipe.shapes.strains.strain_frame import StrainFrame

log = logging.getLogger(__name__)

KIND = "organ_checkpoint"


class FitCheckpoint:
    """The last position of a fit, in a file that is replaced as a whole.

    Only a fit of the same input continues from it: the file has a digest of the input.
    """

    def __init__(self, path: str | Path, given: Given) -> None:
        self.path, self.given, self.digest = Path(path), given, digest(given)

    def read(self) -> FitPosition | None:
        """The position of an earlier run of the same fit, if there is one."""
        if not self.path.exists():
            return None
        try:
            content = artifacts.read(self.path, KIND)
        except InputError as error:
            log.warning("starting from the beginning: %s", error)
            return None
        if content["digest"] != self.digest:
            log.info("%s belongs to a fit of other input; starting from the beginning", self.path)
            return None
        position = self._position(content)
        log.info("continuing from %s: %d steps are done", self.path, len(position.task.search.record))
        return position

    def write(self, position: FitPosition) -> None:
        """Replace the file."""
        task, state = position.task, position.state
        frame = task.frame
        carry = {name: getattr(task.carry, name) for name in ("data", "indices", "indptr")}
        data: dict[str, Any] = {
            "digest": self.digest,
            "vertices": task.mesh.vertices,
            "tets": task.mesh.tets,
            "frame": {} if frame is None else {"rotations": frame.rotations, "before": frame.before},
            "carry": carry,
            "logs": state.unknowns,
            "x": state.x,
            "tangles": state.tangles,
            "record": artifacts.columns(task.search.record),
        }
        data |= {name: getattr(position, name) for name in ("stage", "first", "meshings")}
        artifacts.write(self.path, data, kind=KIND, units={"vertices": "mm", "x": "mm"})

    def done(self) -> None:
        """Remove the file."""
        self.path.unlink(missing_ok=True)

    def _position(self, content: dict[str, Any]) -> FitPosition:
        mesh = TetMesh(content["vertices"], content["tets"])
        shape = (len(self.given.template.vertices), len(mesh.vertices))
        arrays = content["carry"]
        carry = sp.csr_matrix((arrays["data"], arrays["indices"], arrays["indptr"]), shape=shape)
        record = _records(content["record"])
        frame = StrainFrame(**content["frame"]) if content["frame"] else None
        meshed = None if frame is None else carry
        task = OnMesh(self.given, mesh, meshed, frame, record)
        body = task.search.strained(content["logs"])
        state = State(content["logs"], task.attachments, body, content["x"], int(content["tangles"]))
        return FitPosition(task, state, *(int(content[n]) for n in ("stage", "first", "meshings")))


def _records(columns: dict[str, NDArray]) -> list[StepRecord]:
    if not columns:
        return []
    kinds = {f.name: {"str": str, "int": int, "float": float}[str(f.type)] for f in fields(StepRecord)}
    rows = zip(*(columns[name] for name in kinds), strict=True)
    return [StepRecord(*(kind(v) for kind, v in zip(kinds.values(), row, strict=True))) for row in rows]


def digest(given: Given) -> str:
    """SHA-256 in hexadecimal of all that a fit depends on."""
    columns = [f.name for f in fields(StepRecord)]
    found = hashlib.sha256(f"{__version__} {columns} {given.settings!r}".encode())

    def add(*arrays: NDArray) -> None:
        for array in arrays:
            found.update(f"{array.shape} {array.dtype}".encode())
            found.update(np.ascontiguousarray(array).tobytes())

    x = given.template.vertices
    add(x, given.template.tets, given.marks)
    for points in (given.attached, given.known):
        _add_points(add, points)
    for load in given.loads:
        add(np.array(load.value(x)), load.gradient(x))
    if given.image is not None:
        add(given.image.values, given.image.affine)
    return found.hexdigest()


def _add_points(add: Any, points: Attached | None) -> None:
    if points is None:
        add(np.zeros(0))
    else:
        add(points.matrix.data, points.matrix.indices, points.matrix.indptr, points.targets)
