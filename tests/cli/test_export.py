"""What `handpipe export` writes, read by other libraries."""

import json
from pathlib import Path

import meshio
import numpy as np
import pandas as pd
import pytest
from tests.hand.test_export import CUBE, TETS, simulated

from handpipe.cli import export as exports
from handpipe.core import InputError, metrics, paths
from handpipe.core.configuration import Dataset, load_dataset
from handpipe.fem.elements.materials import Material
from handpipe.fem.potentials.elastic import Elastic
from handpipe.hand.frames import write_frames

DATASET = Path(__file__).parents[2] / "config/datasets/phantom-finger.yaml"
ROWS = [
    {"pose": "fist", "error": 0.1, "doubt": 'says "no", twice\nand é'},
    {"pose": "flat", "error": 2.5e-17, "nearest": "spread"},
]


@pytest.fixture
def dataset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Dataset:
    monkeypatch.chdir(tmp_path)
    return load_dataset(DATASET)


def test_tables_and_metrics_are_csv(dataset: Dataset, tmp_path: Path):
    for stage, rows in (("skin", ROWS), ("limits", [])):
        file = paths.at(paths.table_of(stage), subject="finger")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(rows), encoding="utf-8")
    figures = {"skin": {"error_max": (0.25, "mm"), "seconds": (3.0, "s")}, "rig": {"seconds": (1 / 3, "s")}}
    for stage, values in figures.items():
        metrics.write(paths.at(paths.metrics_of(stage), subject="finger"), values)
    written = exports.export("finger", dataset, tmp_path / "out")
    assert [p.name for p in written] == ["finger-limits.csv", "finger-skin.csv", "finger-metrics.csv"]
    table = pd.read_csv(tmp_path / "out/finger-skin.csv", float_precision="round_trip")
    assert list(table) == ["pose", "error", "doubt", "nearest"]
    assert list(table["error"]) == [0.1, 2.5e-17]
    assert table["doubt"][0] == ROWS[0]["doubt"] and table["doubt"].isna()[1]
    found = pd.read_csv(tmp_path / "out/finger-metrics.csv", float_precision="round_trip")
    assert set(zip(found["stage"], found["name"], found["value"], found["unit"], strict=True)) == {
        ("skin", "error_max", 0.25, "mm"), ("skin", "seconds", 3.0, "s"), ("rig", "seconds", 1 / 3, "s"),
    }  # fmt: skip


@pytest.fixture
def scene(dataset: Dataset) -> list:
    """Three frames of a scene in two chunks, the second one's number with more digits."""
    frames = simulated()
    for _, layers in frames:
        layers["muscles"] = {"lumbrical1_mesh": layers["muscles"]["lumbrical1"]}
    for chunk, some in ((9, frames[:1]), (10, frames[1:])):
        write_frames(paths.at(paths.SCENE_CHUNK, subject="finger", scene="close", chunk=chunk), some)
    (paths.at(paths.SIMULATION, subject="finger") / "close" / "close.glb").write_bytes(b"")
    return frames


def test_a_scene_is_usd_where_it_is_asked_for(dataset: Dataset, scene: list, tmp_path: Path):
    pxr = pytest.importorskip("pxr.Usd", reason="usd-core is not installed")
    written = exports.export("finger", dataset, tmp_path / "out", usd=True)
    assert [p.name for p in written] == ["close.glb", "close.usdc"]
    stage = pxr.Stage.Open(str(tmp_path / "out/close.usdc"))
    matrices = stage.GetPrimAtPath("/Hand/bones/distal2").GetAttribute("xformOp:transform")
    moves = [np.array(matrices.Get(time))[3, :3] for time in matrices.GetTimeSamples()]
    np.testing.assert_array_equal(moves, [frame.bones["distal2"].translation for frame, _ in scene])


def test_the_models_of_the_skeleton_are_copied_with_its_meshes(dataset: Dataset, scene: list, tmp_path: Path):
    model = paths.at(paths.SCENE_SKELETON, subject="finger", scene="close")
    (model / "meshes").mkdir(parents=True)
    (model / "skeleton.xml").write_text("<mujoco/>", encoding="utf-8")
    (model / "meshes/distal2.stl").write_bytes(b"solid")
    for _ in range(2):  # files of an earlier export are replaced
        written = exports.export("finger", dataset, tmp_path / "out")
        assert [p.name for p in written] == ["close.glb", "close-skeleton"]
    assert (tmp_path / "out/close-skeleton/skeleton.xml").read_text(encoding="utf-8") == "<mujoco/>"
    assert (tmp_path / "out/close-skeleton/meshes/distal2.stl").is_file()


def test_an_export_again_has_no_scene_that_is_no_longer_built(dataset: Dataset, scene: list, tmp_path: Path):
    folder = paths.at(paths.SIMULATION, subject="finger")
    (folder / "open").mkdir()
    (folder / "open" / "open.glb").write_bytes(b"")
    exports.export("finger", dataset, tmp_path / "out")
    (folder / "open" / "open.glb").unlink()
    written = exports.export("finger", dataset, tmp_path / "out")
    assert [p.name for p in written] == ["close.glb"]
    assert [p.name for p in (tmp_path / "out").glob("*.glb")] == ["close.glb"]


def test_a_scene_of_another_subject_is_not_replaced(dataset: Dataset, scene: list, tmp_path: Path):
    other = paths.at(paths.SIMULATION, subject="thumb") / "close"
    other.mkdir(parents=True)
    (other / "close.glb").write_bytes(b"of the thumb")
    exports.export("finger", dataset, tmp_path / "out")
    with pytest.raises(InputError, match="close.glb.*written by handpipe export finger.*Name another folder"):
        exports.export("thumb", dataset, tmp_path / "out")
    assert (tmp_path / "out/close.glb").read_bytes() == b""


class Muscles:
    """In place of the layer, whose files only a build makes."""

    def elastic_bodies(self, bones: object) -> dict[str, Elastic]:
        return {"lumbrical1_mesh": Elastic(CUBE, TETS, Material(8.0, 0.3))}


def test_a_body_of_a_frame_is_a_deck(
    dataset: Dataset, scene: list, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(exports, "_load", lambda subject, dataset, layer: Muscles())
    exports.deck("finger", dataset, "close", "step_9", "lumbrical1", tmp_path / "deck.inp")
    mesh = meshio.read(tmp_path / "deck.inp", file_format="abaqus")
    np.testing.assert_array_equal(mesh.cells_dict["tetra"], TETS)
    x = scene[1][1]["muscles"]["lumbrical1_mesh"].vertices
    np.testing.assert_allclose(mesh.points.mean(axis=0), x.mean(axis=0))
    assert "lumbrical1 of finger, frame step_9 of scene close" in (tmp_path / "deck.inp").read_text()


@pytest.mark.parametrize(
    ("scene_name", "frame", "body", "message"),
    [
        ("open", "step_9", "lumbrical1", "nothing is simulated yet"),
        ("close", "rest", "lumbrical1", "rest: is no frame.*step_10, step_9, step_8"),
        ("close", "step_9", "flexor2", "flexor2: is no body of tets.*lumbrical1"),
    ],
)
def test_a_deck_of_what_is_absent_is_refused(
    dataset: Dataset, scene: list, tmp_path: Path, scene_name: str, frame: str, body: str, message: str
):
    with pytest.raises(InputError, match=message):
        exports.deck("finger", dataset, scene_name, frame, body, tmp_path / "deck.inp")
    assert not (tmp_path / "deck.inp").exists()
