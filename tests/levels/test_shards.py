"""Training sets: read by the page's reader, the same whatever the shards, with failed frames recorded."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handpipe.core.configuration import Scene, load_dataset
from handpipe.core.errors import InputError
from handpipe.core.layers import Frame
from handpipe.hand.frames import write_frames
from handpipe.hand.simulation import Failure
from handpipe.levels.shards.shard import SPLITS, Shard
from handpipe.skeleton.drivers import landmark_map
from handpipe.skeleton.drivers.landmarks import LANDMARKS
from handpipe.skeleton.joints.angles import write_angles
from handpipe.stages.levels import index_shards, make_shard

from .test_kernels import five_fingers
from .three_bones import frame, rig

ROOT = Path(__file__).parents[2]
DATA = load_dataset(ROOT / "config/datasets/phantom-finger.yaml").model_copy(update={"licence": "CC0-1.0"})
COUNT, LOST = 23, (4, 17)


@pytest.fixture(scope="module")
def reader():
    """The class of the page."""
    text = (ROOT / "docs/how-to/training-sets.md").read_text(encoding="utf-8")
    found = re.search(r"<!-- reader -->\n```python\n(.*?)```", text, re.DOTALL)
    assert found is not None
    assert len(found.group(1).splitlines()) <= 30
    names: dict = {}
    exec(found.group(1), names)
    return names["TrainingSet"]


def angles_of(number: int) -> np.ndarray:
    return np.random.default_rng([7, number]).uniform(-20, 80, 2)


def made(folder: Path, chunk: int, lost: tuple[int, ...] = LOST) -> Path:
    """The shards of frames in chunks of a size, some of them failed, through the stages."""
    folder.mkdir()
    rig().save(folder / "rig.h5")
    names = rig().angle_names
    wanted = {f"random{i + 1}": np.radians(angles_of(i)) for i in range(COUNT)}
    write_angles(folder / "angles.csv", {n: dict(zip(names, v, strict=True)) for n, v in wanted.items()})
    (folder / "random.yaml").write_text(f"random: {{count: {COUNT}, seed: 7, seeds: each}}")
    scene = Scene.model_validate({"layers": ["bones"], "frames": folder / "angles.csv", "chunk": chunk})
    chunks, shards = [], []
    for number, first in enumerate(range(0, COUNT, chunk)):
        numbers = range(first, min(first + chunk, COUNT))
        frames = [frame(f"random{i + 1}", np.radians(angles_of(i))) for i in numbers if i not in lost]
        failures = [Failure(f"random{i + 1}", "fat", "stagnated") for i in numbers if i in lost]
        chunks.append(folder / f"frames-{number}.h5")
        write_frames(chunks[-1], frames, failures=failures)
        shards.append(folder / f"shard-{number}.npz")
        inputs = make_shard.Inputs(folder / "rig.h5", folder / "angles.csv", chunks[-1])
        make_shard.make_shard(inputs, shards[-1], DATA, scene, number)
    inputs = index_shards.Inputs(folder / "rig.h5", folder / "random.yaml", chunks, shards)
    outputs = index_shards.Outputs(folder / "index.json", folder / "bodies.npz")
    index_shards.index_shards(inputs, outputs, DATA, scene, "many")
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(tmp_path_factory.mktemp("shards") / "set", 5)


def joined(training_set) -> dict[str, np.ndarray]:
    """All frames of all splits in the order of their numbers."""
    batches = [batch for split in dict.fromkeys(SPLITS) for batch in training_set.batches(split)]
    order = np.argsort(np.concatenate([batch["number"] for batch in batches]))
    return {name: np.concatenate([batch[name] for batch in batches])[order] for name in batches[0]}


def test_the_reader_gives_every_frame_once_with_its_bodies(folder: Path, reader) -> None:
    read = reader(folder)
    found = joined(read)
    kept = [i for i in range(COUNT) if i not in LOST]
    assert found["number"].tolist() == kept
    assert found["name"].tolist() == [f"random{i + 1}" for i in kept]
    np.testing.assert_allclose(found["angles"], np.radians([angles_of(i) for i in kept]), atol=1e-12)
    truth = [frame("x", np.radians(angles_of(i))) for i in kept]
    np.testing.assert_allclose(
        found["bones"], [[t.bones[b].matrix for b in rig().bones] for t, _ in truth], atol=1e-9
    )
    for body in ("muscles/muscle", "fat/skin"):
        layer, name = body.split("/")
        np.testing.assert_allclose(found[body], [m[layer][name].vertices for _, m in truth], atol=1e-4)
        assert read.bodies[f"{body}/rest"].shape == found[body].shape[1:]
        assert read.bodies[f"{body}/cells"].max() == found[body].shape[1] - 1
    assert {n for n in found if "/" in n} == {"muscles/muscle", "fat/skin"}
    moved = np.einsum("fij,nj->fni", found["bones"][:, 2, :, :3], read.bodies["bones/second/rest"])
    moved += found["bones"][:, 2, None, :, 3]
    shown = [layers["bones"]["second"].vertices for _, layers in truth]
    np.testing.assert_allclose(moved, shown, atol=1e-9)


def test_frames_and_splits_do_not_depend_on_the_shards(folder: Path, reader, tmp_path: Path) -> None:
    few, many = (joined(reader(f)) for f in (made(tmp_path / "few", 16), folder))
    assert few.keys() == many.keys()
    for name, values in few.items():
        assert values.tobytes() == many[name].tobytes(), name
    digits = many["number"] % 10
    assert (many["split"][digits == 9] == "test").all() and (many["split"][digits == 8] == "validation").all()
    assert (many["split"] == "train").sum() == (digits < 8).sum()


def test_the_same_frames_give_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    again = made(tmp_path / "again", 5)
    for path in folder.glob("*.npz"):
        assert path.read_bytes() == (again / path.name).read_bytes()


def test_failed_frames_are_recorded_with_their_reason(folder: Path, capsys) -> None:
    index = json.loads((folder / "index.json").read_text())
    expected = [{"number": i, "name": f"random{i + 1}", "layer": "fat", "reason": "stagnated"} for i in LOST]
    assert index["invalid"] == expected
    assert index["frames"] == COUNT - len(LOST) == sum(index["splits"].values())
    with np.load(folder / "shard-3.npz") as shard:
        assert shard["invalid/number"].tolist() == [17] and 17 not in shard["number"]
        np.testing.assert_allclose(shard["invalid/angles"], np.radians([angles_of(17)]), atol=1e-12)


def test_a_shard_whose_frames_all_failed_is_read(reader, tmp_path: Path) -> None:
    read = reader(made(tmp_path / "set", 5, lost=(0, 1, 2, 3, 4)))
    assert read.index["shards"][0]["frames"] == 0 and len(read.index["invalid"]) == 5
    assert joined(read)["number"].tolist() == list(range(5, COUNT))


def test_the_index_states_origin_units_and_licence(folder: Path) -> None:
    index = json.loads((folder / "index.json").read_text())
    assert (index["subject"], index["hand"], index["licence"]) == ("phantom-finger", "right", "CC0-1.0")
    assert (index["scene"], index["level"]) == ("many", "full")
    assert index["random"] == {
        "count": COUNT, "seed": 7, "around": "limits", "spread": 0.15, "seeds": "each",
    }  # fmt: skip
    assert index["units"]["lengths"] == "mm" and index["units"]["angles"] == "rad"
    assert index["angles"] == {name: list(limits) for name, limits in rig().limits.items()}
    assert index["absent_landmarks"] == list(LANDMARKS)  # its bones have no names of fingers


def test_a_changed_shard_is_refused_by_the_reader(reader, tmp_path: Path) -> None:
    folder = made(tmp_path / "set", 16)
    shard = folder / "shard-1.npz"
    shard.write_bytes(shard.read_bytes()[:-1] + b"x")
    with pytest.raises(ValueError, match="not the file of the index"):
        joined(reader(folder))


def test_a_frame_that_is_neither_computed_nor_failed_is_an_error() -> None:
    wanted = [frame(name, np.zeros(2)) for name in ("a", "b")]
    with pytest.raises(InputError, match="b: is neither computed nor failed"):
        Shard([f for f, _ in wanted], 0, wanted[:1], [], [{}]).arrays(rig(), landmark_map(rig()))


def test_landmarks_are_the_centres_of_joints_in_both_bones_frames() -> None:
    """Of joints without residual motion: parent and child carry the centre to one place."""
    hand = five_fingers.rig()
    joints = [
        replace(j, fit=replace(j.fit, rotation_residual=zero(j), translation_residual=zero(j)))
        for j in hand.joints
    ]
    hand = replace(hand, joints=tuple(joints))
    rng = np.random.default_rng(0)
    angles = {name: rng.uniform(*hand.limits[name]) for name in hand.angle_names}
    posed = Frame("posed", angles, hand.bone_transforms(angles))
    found = Shard([posed], 0, [(posed, {})], [], [{}]).arrays(hand, landmark_map(hand))["landmarks"][0]
    assert found.shape == (21, 3) and np.isfinite(found).all()
    by_child = {joint.child: joint for joint in joints}
    fingers = {"INDEX_FINGER": 2, "MIDDLE_FINGER": 3, "RING_FINGER": 4, "PINKY": 5}
    checked = {"THUMB_CMC": "metacarpal1", "THUMB_MCP": "proximal1", "THUMB_IP": "distal1"}
    for finger, digit in fingers.items():
        checked |= {
            f"{finger}_{e}": f"{b}{digit}"
            for e, b in (("MCP", "proximal"), ("PIP", "middle"), ("DIP", "distal"))
        }
    for name, bone in checked.items():
        joint, point = by_child[bone], found[LANDMARKS.index(name)]
        for carrier in (joint.parent, joint.child):
            np.testing.assert_allclose(posed.bones[carrier](joint.fit.centre), point, atol=1e-9)
    tip = found[LANDMARKS.index("INDEX_FINGER_TIP")]
    surface = posed.bones["distal2"](hand.surfaces["distal2"].vertices)
    assert np.linalg.norm(surface - tip, axis=1).min() < 3


def zero(joint):
    """No residual motion."""
    residual = joint.fit.rotation_residual
    return replace(residual, coefficients=np.zeros_like(residual.coefficients))
