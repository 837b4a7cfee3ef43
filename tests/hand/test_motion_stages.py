"""A motion becomes a table of angles and figures; the figures of its frames have steps, targets and pops."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handpipe.core import metrics
from handpipe.core.configuration import Scene, load_dataset
from handpipe.core.layers import Frame, Shape
from handpipe.evaluation.frames import frame_warnings
from handpipe.hand.frames import write_frames
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.drivers import read_frames
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.joint_tree import RigJoint
from handpipe.skeleton.joints.joints import JointFit
from handpipe.skeleton.joints.residual import Residual
from handpipe.skeleton.rig.rig import Rig
from handpipe.stages.hand import evaluate_frames, expand_motion

DATA = load_dataset(Path(__file__).parents[2] / "config/datasets/phantom-hand-preview.yaml")
TRIANGLES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
CORNERS = np.array([[0.0, 0, 0], [30, 0, 0], [0, 4, 0], [0, 0, 4]])
LIMITS = np.radians([[-10.0, 90.0]])


def hinge():
    """Two tetrahedra of bones that turn about z between them."""
    none = Residual(np.zeros((2, 3)), LIMITS[:, 0], LIMITS[:, 1])
    fit = JointFit(Axes(np.array([[0.0, 0, 1]]), (0,)), np.array([32.0, 0, 0]), none, none, np.zeros((0, 1)))
    bones = {"base": Surface(CORNERS, TRIANGLES), "tip": Surface(CORNERS + [35.0, 0, 0], TRIANGLES)}
    return Rig("base", (RigJoint("hinge", "base", "tip", ("bend",), LIMITS, fit),), bones, {})


@pytest.fixture
def rig(tmp_path):
    made = hinge()
    made.save(tmp_path / "rig.h5")
    return made


def expanded(folder, name, text):
    (folder / name).write_text(text)
    outputs = expand_motion.Outputs(folder / "angles.csv", folder / "motion.json", folder / "rows.json")
    scene = Scene(layers=("bones",), frames=folder / name)
    expand_motion.expand_motion(expand_motion.Inputs(folder / "rig.h5", folder / name), outputs, DATA, scene)
    return outputs


def test_keyframes_through_both_stages(tmp_path, rig):
    made = expanded(tmp_path, "keys.csv", "key,time [frame],bend [deg]\nopen,0,0\nbent,4,8\n")
    angles = read_frames(made.angles, rig)
    assert np.degrees([a["bend"] for a in angles.values()]) == pytest.approx([0, 2, 4, 6, 8])
    assert metrics.read(made.metrics)["frames"] == (5.0, "frames")
    rest = CORNERS + [45.0, 0, 0]
    frames = []
    for i, (name, given) in enumerate(angles.items()):
        if i == 1:
            continue  # a frame that failed: no step to it, and none from it
        bones = rig.bone_transforms(given)
        skin = bones["tip"](rest) + (5.0 if i == 4 else 0.0) * np.eye(3)[2]
        frames.append((Frame(name, given, bones), {"fat": {"skin": Shape(rest, skin, TRIANGLES)}}))
    chunks = [tmp_path / "frames-0.h5", tmp_path / "frames-1.h5"]
    write_frames(chunks[0], frames[:2])
    write_frames(chunks[1], frames[2:])
    others = [tmp_path / f"equilibria-{number}.json" for number in (0, 1)]
    plain = {"starts": 1, "starts_without_result": 0, "other_equilibria": 0}
    away = {
        "other_equilibria": 1,
        "other_start": "blend of the bones",
        "other_energy": 1.1,
        "other_skin_max": 2.5,
    }
    for path, row in zip(others, ({"frame": "open"} | plain, {"frame": "bent"} | plain | away), strict=True):
        path.write_text(json.dumps({"frames": [row]}))
    inputs = evaluate_frames.Inputs(tmp_path / "rig.h5", made.angles, made.table, others, chunks)
    outputs = evaluate_frames.Outputs(tmp_path / "frames.json", tmp_path / "table.json")
    scene = Scene(layers=("bones",), frames=made.angles)
    evaluate_frames.evaluate_frames(inputs, outputs, DATA, scene)
    rows = {row["frame"]: row for row in json.loads(outputs.table.read_text())}
    assert list(rows) == ["open", "open+1", "open+2", "open+3", "bent"]
    assert ["pop" in row for row in rows.values()] == [False, False, False, True, True]
    assert rows["open+3"]["pop"] < 1e-9 and rows["open+3"]["joint_motion"] == pytest.approx(2.0)
    assert rows["bent"]["unexplained"] == pytest.approx(5.0) and rows["bent"]["pop"] == pytest.approx(2.5)
    assert rows["bent"]["distance"] == pytest.approx(8.0)  # deg from neutral, the only pose that was seen
    found = metrics.read(outputs.metrics)
    assert found["pops"] == (1.0, "frames") and found["distance_max"] == (pytest.approx(8.0), "deg")
    assert found["continuity_max"][1] == "mm/deg"
    assert found["frames_with_other_equilibria"] == (1.0, "frames") and found["other_skin_max"] == (2.5, "mm")
    warnings = [text for text in frame_warnings("keys", list(rows.values())) if "equilibria" in text]
    where = "skin up to 2.50 mm from the frame's, elastic energy 1.100 of the frame's"
    assert len(warnings) == 1 and f"bent ({where}; start: blend of the bones)" in warnings[0]
    assert "open (skin" not in warnings[0]


def test_targets_that_are_out_of_reach_are_in_the_table(tmp_path, rig):
    text = "keys:\n- {time: 0}\n- {time: 1, reach: [{bone: tip, at: tip, to: [300, 0, 0]}]}\n"
    made = expanded(tmp_path, "targets.yaml", text)
    table = json.loads(made.table.read_text())
    assert table["said"] and "key2: target 1 is out of reach" in table["said"][0]
    assert table["frames"][1]["target_distance"] > 200 and "target_distance" not in table["frames"][0]
    assert metrics.read(made.metrics)["target_distance_max"][0] > 200


def test_bones_that_pass_through_one_another_are_said_before_any_simulation(tmp_path, caplog):
    """Folded flat, the tip lies in the base."""
    folded = hinge()
    folded.save(tmp_path / "rig.h5")
    tip = Surface(CORNERS + [62.0, 0, 0], TRIANGLES)
    base = Surface(np.array([[-40.0, -8, -8], [60, -8, -8], [-40, 30, -8], [-40, -8, 30]]), TRIANGLES)
    limits = np.radians([[-10.0, 180.0]])
    joint = replace(folded.joints[0], limits=limits)
    Rig("base", (joint,), {"base": base, "tip": tip}, {}).save(tmp_path / "rig.h5")
    made = expanded(tmp_path, "keys.csv", "key,time [frame],bend [deg]\nopen,0,0\nshut,4,170\n")
    (sentence,) = json.loads(made.table.read_text())["said"]
    assert sentence.startswith("shut: base and tip lie up to") and sentence in caplog.text
