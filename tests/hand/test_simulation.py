"""Layers are solved inside out, each from those it needs."""

import json
import logging
from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from handpipe.core import artifacts
from handpipe.core.configuration import Scene
from handpipe.core.errors import ConvergenceError, InputError
from handpipe.core.layers import Frame, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.fem.potentials.viscous_layer import Viscous
from handpipe.hand.frames import finished_frames, frames_to_follow, read_frames, write_frames
from handpipe.hand.simulation import Failure, simulate, simulate_frame
from handpipe.stages.hand import simulate as stage


class _Shifted:
    """A layer that stands one unit further out than the sum of what it needs."""

    def __init__(self, name, needs):
        self.name, self.needs, self.saw = name, needs, []

    def solve(self, frame, below):
        self.saw.append(set(below))
        height = frame.angles["lift"] + 1 + sum(s["body"].vertices.sum() for s in below.values())
        point = np.array([[height, 0.0, 0.0]])
        return {"body": Shape(point, point, np.zeros((0, 3), int))}


class _Broken(_Shifted):
    def solve(self, frame, below):
        raise ConvergenceError(self.name, "no equilibrium")


def _frame(lift):
    return Frame(f"lift{lift}", {"lift": lift}, {})


def test_each_layer_sees_what_it_needs_and_nothing_else():
    bones, muscles, fat = (
        _Shifted("bones", ()),
        _Shifted("muscles", ("bones",)),
        _Shifted("fat", ("muscles",)),
    )
    shapes = simulate_frame(_frame(0.5), [bones, muscles, fat])
    assert list(shapes) == ["bones", "muscles", "fat"]
    assert (bones.saw, muscles.saw, fat.saw) == ([set()], [{"bones"}], [{"muscles"}])
    heights = [shapes[n]["body"].vertices[0, 0] for n in shapes]
    assert heights == [1.5, 3.0, 4.5]


@pytest.mark.parametrize(
    ("frame", "named"),
    [
        (Frame("bad", {"lift": float("nan")}, {}), "frame bad: lift: is not a finite number"),
        (Frame("bad", {"lift": 0.0}, {"b": RigidTransform(np.eye(3), np.full(3, np.inf))}), "not finite"),
        (Frame("bad", {"lift": 0.0}, {"b": RigidTransform(1.1 * np.eye(3), np.zeros(3))}), "not a rotation"),
        (Frame("bad", {"lift": 0.0}, {"b": RigidTransform(-np.eye(3), np.zeros(3))}), "not a rotation"),
    ],
)
def test_a_frame_that_is_no_pose_is_refused_by_name(frame, named):
    layer = _Shifted("bones", ())
    with pytest.raises(InputError, match=named):
        simulate_frame(frame, [layer])
    assert layer.saw == []
    [failure] = simulate([frame], [layer]).failures
    assert failure.frame == "bad" and named in failure.reason


def test_a_frame_is_checked_once_for_all_layers(monkeypatch):
    checked = []
    monkeypatch.setattr(
        "handpipe.hand.simulation.frame_by_frame._require_rigid", lambda frame: checked.append(frame.name)
    )
    layers = [_Shifted("bones", ()), _Shifted("muscles", ("bones",)), _Shifted("fat", ("muscles",))]
    simulate_frame(_frame(0.5), layers)
    simulate([_frame(1.0)], layers)
    assert checked == ["lift0.5", "lift1.0"]


def test_a_layer_that_the_subject_lacks_is_no_obstacle():
    fat = _Shifted("fat", ("bones", "tendons"))
    simulate_frame(_frame(0.0), [_Shifted("bones", ()), fat])
    assert fat.saw == [{"bones"}]


def test_frames_do_not_depend_on_one_another():
    layers = [_Shifted("bones", ()), _Shifted("fat", ("bones",))]
    together = simulate([_frame(1.0), _frame(2.0), _frame(3.0)], layers)
    [(frame, alone)] = simulate([_frame(2.0)], layers).frames
    assert [f.name for f, _ in together.frames] == ["lift1.0", "lift2.0", "lift3.0"]
    assert frame.name == "lift2.0"
    np.testing.assert_array_equal(
        together.frames[1][1]["fat"]["body"].vertices, alone["fat"]["body"].vertices
    )


def test_a_layer_without_equilibrium_stops_the_frame():
    with pytest.raises(ConvergenceError, match="fat"):
        simulate_frame(_frame(0.0), [_Shifted("bones", ()), _Broken("fat", ("bones",))])


class _Picky(_Shifted):
    """Finds no equilibrium in one frame and fails otherwise in another."""

    def solve(self, frame, below):
        if frame.name == "lift2.0":
            raise ConvergenceError("The fat", "no equilibrium")
        if frame.name == "lift3.0":
            raise np.linalg.LinAlgError("singular\nmatrix")
        return super().solve(frame, below)


def test_a_failed_frame_is_named_and_the_others_are_finished(caplog):
    layers = [_Shifted("bones", ()), _Picky("fat", ("bones",)), _Shifted("skin", ("fat",))]
    found = simulate([_frame(x) for x in (1.0, 2.0, 3.0, 4.0)], layers)
    assert [f.name for f, _ in found.frames] == ["lift1.0", "lift4.0"]
    assert found.failures == [
        Failure("lift2.0", "fat", "The fat did not converge: no equilibrium. See the log for its residuals."),
        Failure("lift3.0", "fat", "unexpected LinAlgError: singular\nmatrix"),
    ]
    traced = [record.levelname for record in caplog.records if record.exc_info]
    assert traced == ["ERROR"]  # the unexpected error alone


def test_a_killed_chunk_goes_on_from_what_it_kept():
    layers = [_Shifted("bones", ())]
    wanted = [_frame(x) for x in (1.0, 2.0, 3.0)]
    kept = {}

    def keep(found):
        kept.update({frame.name: (frame, shapes) for frame, shapes in found.frames})
        if len(found.frames) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate(wanted, layers, keep=keep)
    solved = len(layers[0].saw)
    again = simulate(wanted, layers, done=kept)
    assert [f.name for f, _ in again.frames] == ["lift1.0", "lift2.0", "lift3.0"]
    assert (solved, len(layers[0].saw)) == (2, 3)


class _Following(_Shifted):
    """A layer that notes which frame it starts from, and cannot start from `lift9.0`."""

    def __init__(self, name, needs):
        super().__init__(name, needs)
        self.starts = []

    def solve_after(self, before, frame, below):
        then, shapes = before
        self.starts.append((frame.name, then.name, sorted(shapes)))
        if then.name == "lift9.0":
            raise ConvergenceError(self.name, "too far")
        return super().solve(frame, below)


def test_frames_follow_one_another_where_they_are_asked_to():
    bones, flesh = _Shifted("bones", ()), _Following("flesh", ("bones",))
    fat = _Picky("fat", ("bones",))
    wanted = [_frame(x) for x in (1.0, 2.0, 9.0, 4.0)]  # the fat fails in lift2.0
    found = simulate(wanted, [bones, flesh, fat], follow=True)
    inner = ["bones", "flesh"]  # an aid is no organ, but the frame after starts from it
    assert flesh.starts == [
        ("lift2.0", "lift1.0", inner),
        ("lift9.0", "lift2.0", inner),
        ("lift4.0", "lift9.0", inner),
    ]
    assert [(f.name, list(shapes)) for f, shapes in found.frames] == [
        (name, ["bones", "fat"]) for name in ("lift1.0", "lift9.0", "lift4.0")
    ]
    assert len(flesh.saw) == 4  # each frame once, the last one from its own start

    flesh.starts.clear()
    simulate(wanted, [bones, flesh, fat])
    assert flesh.starts == []


def test_frames_that_follow_one_another_are_kept_up_to_the_first_missing_one():
    layers, wanted = [_Following("bones", ()), _Following("flesh", ())], [_frame(x) for x in (1.0, 2.0, 3.0)]
    found = dict(
        zip(("lift1.0", "lift2.0", "lift3.0"), simulate(wanted, layers, follow=True).frames, strict=True)
    )
    bones, flesh = layers

    def again(*kept):
        for layer in layers:
            layer.starts.clear(), layer.saw.clear()
        simulate(wanted, layers, {name: found[name] for name in kept}, follow=True)
        return [(now, before) for now, before, _ in bones.starts]

    assert again("lift1.0", "lift2.0") == [("lift3.0", "lift2.0")]
    assert len(bones.saw) == 1 and len(flesh.saw) == 2  # flesh is in no file: made again for the frame before
    assert flesh.starts[-1][-1] == ["bones", "flesh"]
    assert again("lift1.0", "lift3.0") == [("lift2.0", "lift1.0"), ("lift3.0", "lift2.0")]
    assert again("lift2.0", "lift3.0") == [("lift2.0", "lift1.0"), ("lift3.0", "lift2.0")]
    assert again("lift1.0", "lift2.0", "lift3.0") == []


def test_frames_follow_a_given_one_and_the_first_begins_alone_where_its_aids_fail():
    bones, aid = _Following("bones", ()), _Picky("flesh", ())  # the aid fails in lift2.0
    [before] = simulate([_frame(1.0)], [bones]).frames
    simulate([_frame(3.0)], [bones, aid], follow=True, before=before)
    assert [(now, then) for now, then, _ in bones.starts] == [("lift3.0", "lift1.0")]
    bones.starts.clear()
    [before] = simulate([_frame(2.0)], [bones]).frames
    simulate([_frame(3.0)], [bones, aid], follow=True, before=before)
    assert bones.starts == []


class _Creeping(_Shifted):
    """A layer that is one higher than in the frame before, or at zero; with the height of the layer below."""

    def solve(self, frame, below):
        return self._at(sum(shapes["body"].vertices[0, 2] for shapes in below.values()))

    def solve_after(self, before, frame, below):
        return self._at(before[1][self.name]["body"].vertices[0, 2] + 1.0)

    def _at(self, height):
        point = np.array([[0.0, 0.0, height]])
        return {"body": Shape(0 * point, point, np.zeros((0, 3), int))}


@pytest.mark.parametrize("killed", [False, True])
def test_frames_in_two_jobs_or_after_a_kill_are_those_of_one_job(killed, tmp_path):
    """The flesh depends on its way and is in no frame's shapes: a file has that of its last frame."""
    layers = [_Creeping("flesh", ()), _Shifted("tendons", ("flesh",))]
    layers[1].solve = lambda frame, below: below["flesh"]
    wanted = [_frame(x) for x in (1.0, 2.0, 3.0, 4.0)]
    whole = simulate(wanted, layers, follow=True)
    first = simulate(wanted[:2], layers, follow=True)
    write_frames(tmp_path / "frames-0.h5", first.frames, aids=first.aids, key="same")
    assert all(list(shapes) == ["tendons"] for _, shapes in read_frames(tmp_path / "frames-0.h5"))
    if killed:
        done = finished_frames(tmp_path / "frames-0.h5", "same", wanted)
        found = simulate(wanted, layers, done, follow=True).frames
    else:
        before = frames_to_follow(tmp_path / "frames-0.h5")[-1]
        found = first.frames + simulate(wanted[2:], layers, follow=True, before=before).frames
    heights = [
        [shapes["tendons"]["body"].vertices[0, 2] for _, shapes in frames] for frames in (whole.frames, found)
    ]
    assert heights[0] == heights[1] == [0.0, 1.0, 2.0, 3.0]


def test_a_file_without_the_aids_of_its_last_frame_is_refused_by_name(tmp_path):
    file = tmp_path / "frames-0.h5"
    write_frames(file, simulate([_frame(1.0)], [_Shifted("bones", ())]).frames, key="same")
    assert len(frames_to_follow(file)) == 1
    with h5py.File(file, "a") as content:
        del content["aids"]
    assert len(read_frames(file)) == 1
    with pytest.raises(InputError, match="frames-0.h5: aids: are missing"):
        frames_to_follow(file)
    assert finished_frames(file, "same", [_frame(1.0)]) == {}


def test_progress_is_logged(caplog):
    with caplog.at_level(logging.INFO, logger="handpipe.hand.simulation.frame_by_frame"):
        simulate([_frame(0.0), _frame(1.0)], [_Shifted("bones", ())])
    assert "2 of 2 frames, 0 s left" in caplog.text


def test_what_is_known_is_not_solved_again_and_aids_are_not_handed_on():
    bones, flesh = _Shifted("bones", ()), _Shifted("flesh", ("bones",))
    tendons = _Shifted("tendons", ("bones", "flesh"))
    whole = simulate_frame(_frame(1.0), [bones, flesh, tendons])
    assert list(whole) == ["bones", "tendons"]
    known = {"flesh": flesh.solve(_frame(1.0), {"bones": whole["bones"]})}
    solved = len(flesh.saw)
    again = simulate_frame(_frame(1.0), [bones, flesh, tendons], known)
    assert len(flesh.saw) == solved and set(again) == {"bones", "tendons"}
    np.testing.assert_array_equal(again["tendons"]["body"].vertices, whole["tendons"]["body"].vertices)


@pytest.mark.parametrize("follow", [False, True])
def test_the_stage_simulates_frames_as_the_scene_asks(follow, tmp_path, monkeypatch):
    """A layer that is 1 mm higher than in the frame before: from its own start it is at zero."""

    class Rising(Viscous):
        name, needs = "bones", ()

        def solve(self, frame, below):
            return self._at(0.0)

        def solve_after(self, before, frame, below):
            return self._at(before[1]["bones"]["body"].vertices[0, 2] + 1.0 - self.retardation)

        def _at(self, height):
            point = np.array([[0.0, 0.0, height]])
            return {"body": Shape(point * 0, point, np.zeros((0, 3), int))}

    monkeypatch.setattr(stage, "Rig", SimpleNamespace(load=lambda path: SimpleNamespace(surfaces={})))
    monkeypatch.setattr(stage, "driven_frames", lambda *given: [_frame(x) for x in (1.0, 2.0, 3.0)])
    monkeypatch.setattr(stage, "load_layers", lambda *given: [Rising()])
    monkeypatch.setattr(stage, "key_of", lambda files, asked: json.dumps(asked))
    for name in ("rig.h5", "frames.csv"):
        (tmp_path / name).write_text("", encoding="utf-8")
    inputs = stage.Inputs(rig=tmp_path / "rig.h5", frames=tmp_path / "frames.csv", layers=[])
    scene = Scene(layers=("bones",), frames="frames.csv", follow=follow)
    output, partial = tmp_path / "frames-0.h5", tmp_path / "partial-0.h5"

    def heights(inputs):
        stage.simulate(inputs, output, None, scene, stage.Chunk(0, partial, {}))
        assert not partial.exists()
        return [shapes["bones"]["body"].vertices[0, 2] for _, shapes in read_frames(output)]

    assert heights(inputs) == ([0.0, 1.0, 2.0] if follow else [0.0, 0.0, 0.0])
    assert ("follow" in artifacts.read_attributes(output)["key"]) == follow
    if follow:  # a viscous tissue rises by half of the way, and is made anew where its viscosity is another
        scene = scene.model_copy(update={"viscosity": 0.5 / 24})
        assert heights(inputs) == [0.0, 0.5, 1.0]
        assert json.loads(artifacts.read_attributes(output)["key"])["viscosity"] == str(0.5 / 24)
        scene = scene.model_copy(update={"viscosity": 0.0})
        assert heights(inputs) == [0.0, 1.0, 2.0]
    if follow:  # the next chunk goes on from the last frame of this one
        output, before = tmp_path / "frames-1.h5", output
        assert heights(replace(inputs, before=before)) == [3.0, 4.0, 5.0]


def test_writing_finished_frames_takes_a_tenth_of_the_time_at_most(tmp_path, monkeypatch):
    """Frames of 4 s in a job of 24; a file of n frames takes 0.4 n s, as those of the whole hand do."""
    clock = {"now": 100.0, "writing": 0.0, "simulating": 0.0}
    written = []

    def write(path, frames, aids, key):
        clock["now"] += 0.4 * len(frames)
        clock["writing"] += 0.4 * len(frames)
        written.append(len(frames))

    monkeypatch.setattr(stage, "write_frames", write)
    monkeypatch.setattr(stage.time, "perf_counter", lambda: clock["now"])
    kept = stage._FinishedFrames(tmp_path / "partial-0.h5", "key", 24)
    for count in range(1, 25):
        clock["now"] += 4.0
        clock["simulating"] += 4.0
        kept.keep(SimpleNamespace(frames=[None] * count, failures=[], aids={}))
    assert written[0] == 1 and len(written) >= 4 and 24 not in written
    assert clock["writing"] - 0.4 * written[-1] <= 0.1 * clock["simulating"]
