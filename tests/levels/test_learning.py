"""Known correctives are recovered; left-out frames bound others; the alarm tells poses outside."""

from dataclasses import replace

import numpy as np
import pytest

from handpipe.core.errors import InputError
from handpipe.core.layers import Frame
from handpipe.levels.correctives import Skinned, before_skinning, learn_correctives
from handpipe.levels.learned_hand import LearnedHand
from handpipe.levels.learning import learn
from handpipe.levels.training_set import TrainingSet

from .three_bones import BONES, corrective, frame, known_weights, motions, random_frames, rig, skinned, tube

BOTH = {bone: [(0, 1)] for bone in range(3)}


@pytest.fixture(scope="module")
def hand() -> LearnedHand:
    return learn(random_frames(50), rig())


def test_a_quadratic_corrective_is_recovered_within_rounding() -> None:
    rest = tube(8.0).vertices
    weights, joints = known_weights(rest), np.tile([0, 1, 2, 0], (len(rest), 1))
    given = np.pad(weights, [(0, 0), (0, 1)])
    angles = np.radians(np.random.default_rng(3).uniform(-20, 80, (30, 2)))
    moves = [np.array([np.column_stack([m.rotation, m.translation]) for m in motions(a)]) for a in angles]
    moved = [skinned(rest, weights, a, corrective(rest, a, 0.5)) for a in angles]
    added = np.stack([before_skinning(rest, x, joints, given, m) for x, m in zip(moved, moves, strict=True)])
    assert added[4] == pytest.approx(corrective(rest, angles[4], 0.5), abs=1e-9)
    group = np.zeros(len(rest), np.int64)
    found = learn_correctives(Skinned(rest, group, joints, given, added), angles, BOTH)
    for other in np.radians([[10.0, 35.0], [70.0, -15.0]]):
        out = np.zeros(rest.shape, np.float32)
        found.add(rest.astype(np.float32), other, out)
        assert out == pytest.approx(rest + corrective(rest, other, 0.5), abs=2e-5)


def test_correctives_bring_left_out_frames_near_and_weights_alone_do_not(hand: LearnedHand) -> None:
    for body in (("fat", "skin"), ("muscles", "muscle")):
        errors = hand.bodies[body].errors
        assert errors["L0"].mean > 0.1
        assert errors["L1"].mean < 0.03 * errors["L0"].mean
        assert errors["L1"].frames == 10


def test_without_correctives_weights_alone_are_right_whatever_the_order_of_the_surfaces() -> None:
    plain = learn(random_frames(40, size=0.0), rig())
    assert plain.bodies["fat", "skin"].errors["L0"].largest < 0.05


def test_stated_errors_are_those_of_the_frames_that_were_left_out(hand: LearnedHand) -> None:
    left_out = random_frames(50)[4::5]
    distances = []
    for frame_, layers in left_out:
        x = hand.frame(frame_, "L1")["fat"]["skin"].vertices
        distances.append(np.linalg.norm(x - layers["fat"]["skin"].vertices, axis=1))
    stated = hand.bodies["fat", "skin"].errors["L1"]
    assert stated.mean == pytest.approx(np.mean(distances), rel=1e-3)
    assert stated.largest == pytest.approx(np.max(distances), rel=1e-3)


def test_bones_are_exact_and_all_bodies_are_there(hand: LearnedHand) -> None:
    given, layers = random_frames(1, seed=9)[0]
    for level in ("L0", "L1"):
        found = hand.frame(given, level)
        assert {b for bodies in found.values() for b in bodies} == {*BONES, "muscle", "skin"}
        for bone in BONES:
            assert found["bones"][bone].vertices == pytest.approx(layers["bones"][bone].vertices, abs=1e-4)


def test_the_alarm_is_silent_inside_and_fires_outside(hand: LearnedHand) -> None:
    inside = np.radians(np.random.default_rng(5).uniform(-10, 70, (40, 2)))
    assert np.mean([hand.distance(a) > 1 for a in inside]) < 0.1
    for outside in ([-60.0, 30.0], [30.0, 130.0], [120.0, 120.0]):
        assert hand.distance(np.radians(outside)) > 1
    few = learn(random_frames(50, upper=30.0), rig())
    assert few.distance(np.radians([10.0, 10.0])) < 1 < few.distance(np.radians([70.0, 70.0]))
    figures = few.frame(frame("far", np.radians([70.0, 70.0]))[0], "L1")["fat"]["skin"].figures
    assert figures["level_distance"] > 1
    assert figures["level_bound"] == few.bodies["fat", "skin"].errors["L1"].largest


def test_a_written_hand_and_a_part_of_it_give_the_same_vertices(hand: LearnedHand, tmp_path) -> None:
    hand.save(tmp_path / "levels.h5")
    read, angles = LearnedHand.load(tmp_path / "levels.h5"), np.radians([25.0, 50.0])
    part = hand.only(lambda body: body == ("fat", "skin"))
    for level in ("L0", "L1"):
        x = hand.vertices(angles, level)
        assert np.array_equal(read.vertices(angles, level), x)
        assert np.array_equal(part.vertices(angles, level), hand.split(x)["fat", "skin"])
    assert read.distance(angles) == hand.distance(angles)
    assert read.bodies["fat", "skin"].errors["L1"].mean == hand.bodies["fat", "skin"].errors["L1"].mean


def test_frames_do_not_depend_on_one_another(hand: LearnedHand) -> None:
    angles = np.radians([25.0, 50.0])
    first = hand.vertices(angles)
    hand.vertices(np.radians([-10.0, 5.0]))
    assert np.array_equal(hand.vertices(angles), first)


def test_the_root_may_move(hand: LearnedHand) -> None:
    given, layers = random_frames(1, seed=9)[0]
    shift = np.array([3.0, -4.0, 5.0])
    bones = {b: replace(t, translation=t.translation + shift) for b, t in given.bones.items()}
    found = hand.frame(Frame("moved", given.angles, bones), "L1")["fat"]["skin"].vertices
    assert found == pytest.approx(hand.frame(given, "L1")["fat"]["skin"].vertices + shift, abs=1e-4)


def test_what_cannot_be_learned_is_refused() -> None:
    frames = random_frames(12)
    with pytest.raises(InputError, match=r"frames: are 9; levels are learned from 10"):
        learn(frames[:9], rig())
    with pytest.raises(InputError, match="there is none"):
        TrainingSet.of([])
    lost = [(f, {k: v for k, v in s.items() if k != "muscles" or i != 3}) for i, (f, s) in enumerate(frames)]
    with pytest.raises(InputError, match=r"frame random3: muscles/muscle is missing"):
        learn(lost, rig())
    other = [*frames[:-1], (Frame("odd", {"bend": 0.1}, frames[-1][0].bones), frames[-1][1])]
    with pytest.raises(InputError, match="frame odd: its angles are other ones"):
        learn(other, rig())
