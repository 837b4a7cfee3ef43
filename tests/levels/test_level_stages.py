"""Levels through their stages: learned from files of frames, then a scene's frames with bounds and alarms."""

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from handpipe.core import metrics
from handpipe.core.configuration import Scene, load_dataset, load_scene
from handpipe.core.errors import InputError
from handpipe.evaluation.frames import frame_warnings, with_figures
from handpipe.hand.frames import read_frames, write_frames
from handpipe.levels import require_learned
from handpipe.stages.levels import animate, learn_levels

from .three_bones import frame, random_frames, rig

DATA = load_dataset(Path(__file__).parents[2] / "config/datasets/phantom-hand-preview.yaml")
LAYERS = "layers: [bones, muscles, fat]\nframes: angles.csv\n"


@pytest.fixture(scope="module")
def learned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("levels")
    rig().save(folder / "rig.h5")
    frames = random_frames(30)
    write_frames(folder / "frames-0.h5", frames[:16])
    write_frames(folder / "frames-1.h5", frames[16:])
    names = ("levels.h5", "levels.npz", "levels.json", "rows.json")
    outputs = learn_levels.Outputs(*(folder / name for name in names))
    chunks = [folder / f"frames-{i}.h5" for i in range(2)]
    learn_levels.learn_levels(learn_levels.Inputs(folder / "rig.h5", chunks), outputs)
    return folder


def test_figures_are_by_level_and_tissue(learned) -> None:
    found = metrics.read(learned / "levels.json")
    assert found["frames"] == (30.0, "frames")
    assert found["l1_skin_error_mean"][0] < found["l0_skin_error_mean"][0]
    assert found["l1_muscles_error_max"][0] >= found["l1_muscles_error_mean"][0]
    rows = json.loads((learned / "rows.json").read_text())
    assert {(r["body"], r["level"]) for r in rows} == set(product(("skin", "muscle"), ("L0", "L1")))


def test_a_scene_at_a_level_has_frames_near_the_truth_and_names_those_outside(learned, capsys) -> None:
    text = "frame,first_bend [deg],second_bend [deg]\nrest,0,0\nbent,40,50\nfar,79,-19\n"
    (learned / "angles.csv").write_text(text)
    scene = Scene.model_validate(
        {"layers": ["bones", "fat"], "frames": learned / "angles.csv", "level": "L1", "learned": "random"}
    )
    inputs = animate.Inputs(learned / "rig.h5", learned / "angles.csv", learned / "levels.h5")
    animate.animate(inputs, learned / "frames-9.h5", DATA, scene, 0)
    frames = read_frames(learned / "frames-9.h5")
    assert [f.name for f, _ in frames] == ["rest", "bent", "far"]
    skin = frames[1][1]["fat"]["skin"]
    truth = frame("bent", np.radians([40.0, 50.0]))[1]["fat"]["skin"].vertices
    assert np.linalg.norm(skin.vertices - truth, axis=1).max() <= skin.figures["level_bound"]
    rows = with_figures([{"frame": f.name} for f, _ in frames], frames, [])
    alarmed = [r["frame"] for r in rows if float(r["fat_level_distance"]) > 1]
    said = capsys.readouterr().err
    assert [n for n in ("rest", "bent", "far") if f"frame {n}:" in said] == alarmed
    warned = [w for w in frame_warnings("scene", rows) if "unlike the poses" in w]
    assert bool(warned) == bool(alarmed)


def test_a_scene_shows_the_layers_that_it_needs(learned) -> None:
    scene = Scene.model_validate(
        {"layers": ["muscles"], "frames": learned / "angles.csv", "level": "L0", "learned": "random"}
    )
    (learned / "angles.csv").write_text("frame,first_bend [deg],second_bend [deg]\nfar,75,75\n")
    inputs = animate.Inputs(learned / "rig.h5", learned / "angles.csv", learned / "levels.h5")
    animate.animate(inputs, learned / "frames-8.h5", DATA, scene, 0)
    [(_, shapes)] = read_frames(learned / "frames-8.h5")
    assert set(shapes) == {"bones", "muscles"}


@pytest.mark.parametrize(
    ("further", "said"),
    [
        ("level: L1\n", "names a scene of random poses"),
        ("learned: random\n", "names a scene of random poses"),
        ("level: L3\nlearned: random\n", "names a scene of random poses"),
        ("level: L3\n", "L3 has no muscles, fat; its layers are bones, skin"),
        ("level: L4\n", "level"),
        ("level: L2\nlearned: random\n", "names a scene of random poses"),
        ("level: L2\n", "L2 has no fat; its layers are bones, muscles, skin"),
        ("level: L0\nlearned: random\nequilibria: true\n", "neither mechanics nor equilibria"),
    ],
)
def test_wrong_fields_are_refused(tmp_path, further, said) -> None:
    (tmp_path / "scene.yaml").write_text(LAYERS + further)
    with pytest.raises(InputError, match=said):
        load_scene(tmp_path / "scene.yaml")


def test_the_scene_that_is_learned_from_has_to_suit(tmp_path) -> None:
    base = {"frames": "x.csv"}
    scene = Scene.model_validate({**base, "layers": ["fat"], "level": "L1", "learned": "other"})
    require_learned("s.yaml", scene, Scene.model_validate({**base, "layers": ["bones", "fat"]}))
    for other, said in (
        ({"layers": ["fat"], "level": "L0", "learned": "third"}, "is itself of level L0"),
        ({"layers": ["muscles"]}, "other has no fat"),
        ({"layers": ["fat"], "only": ["index"]}, "models other bones"),
    ):
        with pytest.raises(InputError, match=said):
            require_learned("s.yaml", scene, Scene.model_validate({**base, **other}))
