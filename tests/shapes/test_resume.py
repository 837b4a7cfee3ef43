"""Fits that were killed go on from their last step and end as if nothing had happened."""

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
import trimesh

from handpipe.fem.potentials.pull import Pull
from handpipe.mesh.generation.meshing import tetrahedralise
from handpipe.mesh.generation.remeshing import remesh
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.shapes.observations.marks import Pairs
from handpipe.shapes.optimisation.settings import OrganSettings
from handpipe.shapes.organs.organ import Observed, OrganFit, fit_organ
from handpipe.shapes.organs.remeshing import Given, OnMesh
from handpipe.shapes.organs.resume import FitCheckpoint, digest
from handpipe.shapes.organs.stages import NEW_TETS, FitPosition

SPHERE = trimesh.creation.icosphere(subdivisions=3)
MESH = tetrahedralise(remesh(Surface(8.0 * SPHERE.vertices, SPHERE.faces), 4.0), 4.0)
ATTACHED = np.argsort(MESH.vertices[:, 0])[:4]
LONG = MESH.vertices * [2.4, 0.8, 0.6]


class Killed(Exception):
    """What ends a run in the middle."""


def fit(checkpoint: Path | None = None) -> OrganFit:
    """A ball that grows so long that it is meshed anew, attached and under a load."""
    tip = np.argsort(MESH.vertices[:, 0])[-4:]
    load = Pull(sp.identity(len(MESH.vertices), format="csr")[tip], np.tile([0.0, 0.0, 0.05], (4, 1)))
    return fit_organ(
        MESH,
        Observed(LONG[MESH.boundary_vertices()], attachments=Pairs(MESH.vertices[ATTACHED], LONG[ATTACHED])),
        loads=[load],
        settings=OrganSettings(remesh_below=13.0, iterations=2),
        checkpoint=checkpoint,
    )


def killed_after(steps: int, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that ends when it has written that many positions."""
    count = 0
    write = FitCheckpoint.write

    def counted(self: FitCheckpoint, position: FitPosition) -> None:
        nonlocal count
        write(self, position)
        count += 1
        if count == steps:
            raise Killed

    with monkeypatch.context() as patch:
        patch.setattr(FitCheckpoint, "write", counted)
        with pytest.raises(Killed):
            fit(path)


def test_a_killed_fit_ends_as_one_that_was_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    whole = fit()
    assert whole.quality["new_meshes"][0] >= 1
    path = tmp_path / "fit.h5"
    killed_after(3, path, monkeypatch)
    steps = sum(r.stage != NEW_TETS for r in whole.record)
    killed_after(steps - 3 - 2, path, monkeypatch)  # goes on from 3, and is killed when it has new tets
    caplog.set_level("INFO", "handpipe.shapes")
    again = fit(path)
    assert "continuing from" in caplog.text
    assert not path.exists()
    assert again.mesh.tets.tolist() == whole.mesh.tets.tolist()
    assert again.mesh.vertices == pytest.approx(whole.mesh.vertices, abs=1e-9)
    assert again.strains == pytest.approx(whole.strains, abs=1e-9)
    assert again.carried == pytest.approx(whole.carried, abs=1e-9)
    for found, expected in zip(again.record, whole.record, strict=True):
        assert asdict(replace(found, seconds=0.0)) == pytest.approx(asdict(replace(expected, seconds=0.0)))


def written(path: Path) -> tuple[Given, FitPosition]:
    """A position in a file."""
    given = Given(MESH, LONG, None, None, (), None, OrganSettings())
    task = OnMesh.of_template(given)
    state = task.search.at(np.full((len(MESH.tets), 6), 0.01), task.attachments, MESH.vertices)
    position = FitPosition(task, state, 2, 0, 1)
    FitCheckpoint(path, given).write(position)
    return given, position


def test_a_position_comes_back_as_it_was(tmp_path: Path) -> None:
    given, position = written(tmp_path / "fit.h5")
    found = FitCheckpoint(tmp_path / "fit.h5", given).read()
    assert found is not None
    assert (found.stage, found.first, found.meshings) == (2, 0, 1)
    assert np.array_equal(found.state.x, position.state.x)
    assert np.array_equal(found.state.body.strains, position.state.body.strains)


def test_a_fit_of_other_input_starts_anew(tmp_path: Path) -> None:
    given, _ = written(tmp_path / "fit.h5")
    other = replace(given, marks=given.marks[1:])
    assert FitCheckpoint(tmp_path / "fit.h5", other).read() is None
    assert FitCheckpoint(tmp_path / "nothing.h5", given).read() is None


def test_a_file_that_cannot_be_read_is_left_aside(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    given, _ = written(tmp_path / "fit.h5")
    (tmp_path / "fit.h5").write_bytes((tmp_path / "fit.h5").read_bytes()[:500])
    assert FitCheckpoint(tmp_path / "fit.h5", given).read() is None
    assert "starting from the beginning" in caplog.text


def test_the_digest_tells_all_input_apart() -> None:
    points = Pairs(MESH.vertices[:4], MESH.vertices[:4]).attached(MESH)
    moved = replace(points, targets=points.targets + 1e-6)
    load = Pull(sp.identity(len(MESH.vertices), format="csr")[:1], np.ones((1, 3)))
    twice = Pull(sp.identity(len(MESH.vertices), format="csr")[:1], np.full((1, 3), 2.0))
    given = Given(MESH, LONG, points, points, (load,), None, OrganSettings())
    others = [
        replace(given, template=TetMesh(MESH.vertices + 1e-6, MESH.tets)),
        replace(given, marks=LONG[:-1]),
        replace(given, attached=moved),
        replace(given, known=moved),
        replace(given, known=None),
        replace(given, loads=(twice,)),
        replace(given, loads=()),
        replace(given, settings=OrganSettings(alpha=3.0)),
    ]
    assert len({digest(g) for g in [given, *others]}) == len(others) + 1
    assert digest(replace(given)) == digest(given)
