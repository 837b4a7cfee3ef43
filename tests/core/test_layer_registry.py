"""One record a layer: everything that lists layers reads it."""

import sys
from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks.trust.stale import workbench

from handpipe.core.configuration.scene import Scene
from handpipe.core.layer_registry import (
    LAYERS,
    LayerRecord,
    Look,
    artifacts_of,
    inner_layers,
    made,
    under_fat,
)
from handpipe.core.layers import Frame, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.hand.appearance import colour, opacity
from handpipe.hand.exports.export import write_vtu_series
from handpipe.hand.layer_loading import load_layers
from handpipe.hand.simulation import simulate_frame
from handpipe.mesh.surfaces.surface import Surface

TETRAHEDRON = Surface(
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)
SUBJECT = SimpleNamespace(tendons={"a": None, "b": None}, muscles={}, ligaments={"l": None}, fleshed=False)


class _Toy:
    """A tetrahedron for each of its files, above the bones."""

    name = "toy"
    needs = ("bones",)

    def __init__(self, files):
        self.files = files

    def solve(self, frame, below):
        top = max(shape.vertices[:, 2].max() for shape in below["bones"].values())
        above = TETRAHEDRON.vertices + [0.0, 0.0, top + 1.0]
        return {file.stem: Shape(above, above, TETRAHEDRON.triangles) for file in self.files}


def load_toy(files, _):
    return _Toy(files)


@pytest.fixture
def toy(monkeypatch):
    """A layer added by one record."""
    monkeypatch.setitem(sys.modules, "toy_layer", SimpleNamespace(load=load_toy))
    record = LayerRecord(
        needs=("bones",),
        load="toy_layer:load",
        artifacts=("toys/{member}.h5",),
        members="tendons",
        look=Look((0.1, 0.2, 0.3), opacity=0.4),
    )
    monkeypatch.setitem(LAYERS, "toy", record)


def test_one_record_adds_a_layer_to_scenes_loading_simulation_and_exports(toy, tmp_path):
    scene = Scene(layers=("toy",), frames="x.csv")
    assert scene.needed == ["bones", "toy"]
    assert artifacts_of(scene.needed, SUBJECT) == ["rig.h5", "toys/a.h5", "toys/b.h5"]
    files = [tmp_path / path for path in artifacts_of(scene.needed, SUBJECT)]
    layers = load_layers(scene.needed, SUBJECT, files, {"bone": TETRAHEDRON})
    frame = Frame("lifted", {}, {"bone": RigidTransform(np.eye(3), np.array([0.0, 0, 5]))})
    shapes = simulate_frame(frame, layers)
    assert {name: s.vertices[0, 2] for name, s in shapes["toy"].items()} == {"a": 7.0, "b": 7.0}
    assert (colour("toy"), opacity("toy")) == ((0.1, 0.2, 0.3), 0.4)
    assert "toy" in inner_layers()
    written = [
        path.name for path in write_vtu_series(tmp_path / "vtk", [(frame, {"bones": shapes["bones"]})])
    ]
    assert written == ["bones.pvd"]


@pytest.mark.parametrize("count", [1, 3])
def test_files_that_are_not_the_artifacts_of_the_layers_are_refused(toy, tmp_path, count):
    files = [tmp_path / f"{i}.h5" for i in range(count)]
    with pytest.raises(ValueError, match="zip"):
        load_layers(["toy"], SUBJECT, files, {})


def test_one_record_adds_a_layer_to_the_workflow(monkeypatch):
    """Its artifact is one that a rule makes already, so that jobs can be planned."""
    record = LayerRecord(
        needs=("bones",), load="handpipe.skeleton.posing.layer:load", artifacts=("fascia/bone.h5",)
    )
    monkeypatch.setitem(LAYERS, "toy", record)
    with workbench() as bench:
        bench.before("phantom-finger")
        bench.write("scenes/flexion", {**bench.contents["scene"], "layers": ["toy"]})
        rules = bench.plan("phantom-finger").rules()
    assert {"make_bone_fascia", "simulate"} <= rules
    assert rules.isdisjoint({"extract_tendon", "make_skin", "fit_ligament"})


def test_code_of_a_layer_reruns_the_simulations_that_load_it(monkeypatch):
    """No import shows it: a record names the module. A scene without tendons does not depend on theirs."""
    with workbench() as bench:
        before = bench.before("phantom-finger")
        bench.write("scenes/flexion", {**bench.contents["scene"], "layers": ["bones"]})
        bare = bench.plan("phantom-finger")
        moved = replace(LAYERS["tendons"], load="handpipe.tissues.tendons.fitting.motion:load")
        monkeypatch.setitem(LAYERS, "tendons", moved)
        assert bench.plan("phantom-finger").changed(bare) == set()
        bench.write("scenes/flexion", bench.contents["scene"])
        changed = {job.rule for job in bench.plan("phantom-finger").changed(before)}
    assert changed == {"simulate", "simulate_inner"}


def test_layers_stand_inside_out():
    names = list(LAYERS)
    for name, record in LAYERS.items():
        assert [n for n in record.needs if names.index(n) >= names.index(name)] == []


@pytest.mark.parametrize("name", LAYERS)
def test_every_layer_has_the_loader_that_its_record_names(name):
    module, _, function = LAYERS[name].load.partition(":")
    assert callable(getattr(import_module(module), function))


def test_a_subject_lacks_layers_without_members_and_flesh_without_a_scan():
    assert made(LAYERS, SUBJECT) == ["bones", "bone_fascia", "tendons", "ligaments", "fat"]
    assert made(["bones", "skin"], SUBJECT) == ["bones", "skin"]


def test_artifacts_are_those_of_each_member():
    found = artifacts_of(["tendons", "ligaments", "muscles", "fat"], SUBJECT)
    assert found == [
        "tendons/a/hooks.h5",
        "tendons/b/hooks.h5",
        "ligaments/l.h5",
        "fat/mesh.h5",
        "fat/strains.h5",
    ]


def test_the_fat_lies_on_organs_under_it():
    assert set(under_fat()) < set(inner_layers())
