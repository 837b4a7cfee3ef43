"""The command: files in, a fitted organ and its quality out; errors that say where."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import trimesh
from tests.tissues.muscles.shapes import box

from handpipe.core import artifacts, metrics
from handpipe.core.errors import InputError
from handpipe.imaging.evidence.markers import read_markers, write_markers
from handpipe.imaging.volumes.volume import Volume, write_volume
from handpipe.mesh.files import read_surface
from handpipe.mesh.generation.meshing import tetrahedralise
from handpipe.mesh.generation.remeshing import remesh
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.shapes.__main__ import main
from handpipe.shapes.observations.marks import Pairs
from handpipe.shapes.optimisation.settings import OrganSettings
from handpipe.shapes.organs.files import read_pairs, read_template
from handpipe.shapes.organs.organ import Observed, fit_organ

MESH = box((6, 2, 2), (30.0, 8.0, 8.0))
GROWN = MESH.moved(MESH.vertices * [1.0, 1.3, 0.9] - [0.0, 1.0, 0.0])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    meshio.write(tmp_path / "organ.vtk", meshio.Mesh(MESH.vertices, [("tetra", MESH.tets)]))
    faces = GROWN.boundary_faces()[0]
    write_markers(tmp_path / "marks.mrk.json", GROWN.vertices[faces].mean(axis=1))
    held = np.flatnonzero(MESH.vertices[:, 0] == 0)
    labels = [str(i) for i in held]
    write_markers(tmp_path / "points.mrk.json", MESH.vertices[held], labels)
    write_markers(tmp_path / "places.mrk.json", GROWN.vertices[held][::-1], labels[::-1])
    return tmp_path


def test_files_in_files_out(folder: Path, capsys: pytest.CaptureFixture) -> None:
    pairs = [str(folder / "points.mrk.json"), str(folder / "places.mrk.json")]
    out = folder / "out"
    arguments = [str(folder / "organ.vtk"), str(folder / "marks.mrk.json"), "--attachments", *pairs]
    assert main([*arguments, "--output", str(out), "--iterations", "6"]) == 0
    quality = metrics.read(out / "quality.json")
    assert quality["marks_mean"][0] < 0.1
    assert quality["attachments_max"][0] < 0.2
    assert quality["volume_after"][0] == pytest.approx(GROWN.volumes().sum(), rel=0.02)
    assert quality["smallest_dihedral_before"][0] == pytest.approx(MESH.smallest_dihedral())
    assert "volume_after" in capsys.readouterr().out
    fit = artifacts.read(out / "fit.h5", "organ")
    written = meshio.read(out / "fitted.vtu")
    assert written.points == pytest.approx(fit["vertices"])
    assert written.cell_data["plastic_strain"][0].shape == (len(MESH.tets), 6)
    assert len(fit["record"]["objective"]) > 2
    assert (out / "surface.ply").exists()
    assert not (out / "checkpoint.h5").exists()
    assert fit["rest_vertices"] == pytest.approx(MESH.vertices)
    assert fit["template_vertices"] == pytest.approx(fit["vertices"])


def test_marks_are_found_in_an_image(tmp_path: Path) -> None:
    sphere = trimesh.creation.icosphere(subdivisions=3)
    ball = tetrahedralise(remesh(Surface(8.0 * sphere.vertices, sphere.faces), 2.5), 2.5)
    meshio.write(tmp_path / "ball.vtk", meshio.Mesh(ball.vertices, [("tetra", ball.tets)]))
    semiaxes, spacing = np.array([9.5, 8.0, 7.0]), 0.5
    grid = spacing * (np.indices((56, 56, 56)).reshape(3, -1).T - 27.5)
    rho = np.linalg.norm(grid / semiaxes, axis=1)
    depth = (1 - rho) * rho / np.linalg.norm(grid / semiaxes**2, axis=1)  # to first order
    values = 400.0 * np.clip(0.5 + depth / (2 * spacing), 0.0, 1.0).reshape(56, 56, 56)
    affine = np.diag([spacing, spacing, spacing, 1.0])
    affine[:3, 3] = -27.5 * spacing
    write_volume(tmp_path / "image.nii.gz", Volume(values.astype(np.float32), affine))
    arguments = [str(tmp_path / "ball.vtk"), "--volume", str(tmp_path / "image.nii.gz"), "--iterations", "3"]
    assert main([*arguments, "--output", str(tmp_path / "out")]) == 0
    quality = metrics.read(tmp_path / "out" / "quality.json")
    assert quality["image_marks"][0] > 0.8 * len(ball.boundary_vertices())
    x = read_surface(tmp_path / "out" / "surface.ply").vertices
    before = np.abs(np.linalg.norm(ball.vertices[ball.boundary_vertices()] / semiaxes, axis=1) - 1) * 8.0
    after = np.abs(np.linalg.norm(x / semiaxes, axis=1) - 1) * 8.0
    assert before.mean() > 0.5
    assert after.mean() < 0.1
    assert after.max() < 0.4


def test_errors_name_the_file(folder: Path, capsys: pytest.CaptureFixture) -> None:
    assert main([str(folder / "nothing.vtk"), str(folder / "marks.mrk.json")]) == 1
    assert "nothing.vtk: file: does not exist" in capsys.readouterr().err
    (folder / "places.mrk.json").write_text(json.dumps({"markups": []}))
    with pytest.raises(InputError, match=r"places.mrk.json"):
        read_pairs(folder / "points.mrk.json", folder / "places.mrk.json")


CASES = Path(__file__).parents[3] / "shared" / "cases"
shared = pytest.mark.skipif(not CASES.is_dir(), reason="the shared cases are not beside the checkout")


@pytest.mark.parametrize(
    "option",
    [
        ("--alpha", "nan"),
        ("--alpha", "-1"),
        ("--alpha", "0"),
        ("--beta", "inf"),
        ("--iterations", "-3"),
        ("--iterations", "2.5"),
        ("--enough", "nan"),
        ("--remesh-below", "-1"),
        ("--young", "0"),
        ("--poisson", "0.5"),
    ],
    ids=" ".join,
)
def test_numbers_out_of_range_are_refused_by_option(
    folder: Path, capsys: pytest.CaptureFixture, option: tuple[str, str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        main(
            [
                str(folder / "organ.vtk"),
                str(folder / "marks.mrk.json"),
                *option,
                "--output",
                str(folder / "o"),
            ]
        )
    assert caught.value.code == 2
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith(f"handpipe: argument {option[0]}: ")
    assert not (folder / "o").exists()


@pytest.mark.parametrize(("name", "value"), [("alpha", float("nan")), ("spring", -1.0), ("progress", 2.0)])
def test_settings_are_in_range(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        OrganSettings(**{name: value})


@shared
def test_a_template_in_centimetres_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    case = CASES / "units-cm"
    assert main([str(case / "cm.vtk"), str(case / "marks.mrk.json"), "--output", str(tmp_path / "out")]) == 1
    [line] = capsys.readouterr().err.splitlines()
    assert "cm.vtk: units: " in line
    assert not (tmp_path / "out").exists()
    assert "centimetres: scale by 10" in line


@shared
@pytest.mark.parametrize("marks", ["u1", "u3"])
def test_points_that_are_not_placed_do_not_count(marks: str, caplog: pytest.LogCaptureFixture) -> None:
    """All other points are within the template's reach; the old position is 200 mm off."""
    template = read_template(CASES / "marks-not-placed" / "organ.vtk")
    points, labels = read_markers(CASES / "marks-not-placed" / f"{marks}.mrk.json")
    assert len(points) == 111
    assert "F-4" not in labels
    assert np.abs(points - template.vertices.mean(axis=0)).max() < np.ptp(template.vertices, axis=0).max()
    assert "1 points are not placed and are skipped: F-4" in caplog.text


def given(template: TetMesh = MESH, **changes: Any) -> tuple[TetMesh, Observed]:
    """What `fit_organ` gets, with a change."""
    held = Pairs(MESH.vertices[:8], GROWN.vertices[:8])
    return template, replace(Observed(GROWN.boundary().vertices, held), **changes)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"template": MESH.moved(MESH.vertices / 10)}, "centimetres"),
        ({"marks": GROWN.vertices / 25.4, "attachments": None}, "inches: scale by 25.4"),
        ({"marks": GROWN.vertices * 1000, "attachments": None}, "micrometres: scale by 0.001"),
        (
            {"attachments": Pairs(MESH.vertices[:8] * [-1, -1, 1] - [20, 20, 0], GROWN.vertices[:8])},
            "away from it",
        ),
        ({"marks": np.vstack([GROWN.vertices, [[200.0, 0, 0]]])}, "is mark 63 at (200, 0, 0)"),
        (
            {"volume": Volume(np.zeros((60, 40, 40), np.float32), np.eye(4) - 99 * np.eye(4, k=3))},
            "0 % of its vertices are in the image",
        ),
    ],
)
def test_what_is_in_another_frame_or_unit_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as caught:
        fit_organ(*given(**changes))
    assert said in str(caught.value)


def test_a_foreign_exception_is_one_line(
    folder: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("singular\nmatrix")

    monkeypatch.setattr("handpipe.shapes.__main__.fit_organ", fail)
    assert (
        main([str(folder / "organ.vtk"), str(folder / "marks.mrk.json"), "--output", str(folder / "o")]) == 1
    )
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("handpipe: unexpected LinAlgError: singular matrix. The log is ")
    log = Path(line.split("The log is ")[1])
    assert "Traceback" in log.read_text()
    log.unlink()


def test_an_output_that_cannot_be_made_is_said_first(folder: Path, capsys: pytest.CaptureFixture) -> None:
    (folder / "file").write_text("no folder")
    output = str(folder / "file" / "out")
    assert main([str(folder / "organ.vtk"), str(folder / "marks.mrk.json"), "--output", output]) == 1
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith(f"handpipe: {output}: ")


def test_unequal_labels_are_refused(folder: Path) -> None:
    write_markers(folder / "places.mrk.json", GROWN.vertices[:1], ["elsewhere"])
    with pytest.raises(InputError, match="lacks"):
        read_pairs(folder / "points.mrk.json", folder / "places.mrk.json")


def test_templates_are_checked(folder: Path) -> None:
    assert len(read_template(folder / "organ.vtk").tets) == len(MESH.tets)
    mirrored = MESH.tets[:, [0, 2, 1, 3]]
    meshio.write(folder / "mirrored.vtk", meshio.Mesh(MESH.vertices, [("tetra", mirrored)]))
    assert (read_template(folder / "mirrored.vtk").volumes() > 0).all()
    meshio.write(folder / "metres.vtk", meshio.Mesh(MESH.vertices / 1000, [("tetra", MESH.tets)]))
    with pytest.raises(InputError, match="metres"):
        read_template(folder / "metres.vtk")
    meshio.write(folder / "shell.vtk", meshio.Mesh(MESH.vertices, [("triangle", MESH.boundary_faces()[0])]))
    with pytest.raises(InputError, match="there are none"):
        read_template(folder / "shell.vtk")
    (folder / "broken.vtk").write_text("nonsense")
    with pytest.raises(InputError, match="cannot be read"):
        read_template(folder / "broken.vtk")
