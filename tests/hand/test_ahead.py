"""Layers that another process simulates ahead give what one process gives, errors and log lines too."""

import logging
import os
import signal
import time
from functools import partial

import numpy as np
import pytest

from handpipe.core.errors import ConvergenceError, HandpipeError, InputError
from handpipe.core.layers import Frame, Shape
from handpipe.hand.simulation import Failure, attempts, simulate, simulated_ahead

log = logging.getLogger("handpipe.tests")
FRAMES = [Frame(f"lift{x}", {"lift": float(x)}, {}) for x in range(1, 6)]


class Stacked:
    """A layer one unit above what it needs; after another frame half as high again as there."""

    def __init__(self, name, needs=(), fails=""):
        self.name, self.needs, self.fails = name, needs, fails

    def solve(self, frame, below):
        if frame.name == self.fails:
            raise ConvergenceError(self.name, "no equilibrium")
        log.warning("%s of %s", self.name, frame.name)
        height = frame.angles["lift"] + sum(shapes["body"].vertices.sum() for shapes in below.values())
        point = np.array([[height + 1.0, 0.0, 0.0]])
        return {"body": Shape(point, point, np.zeros((0, 3), int))}

    def solve_after(self, before, frame, below):
        alone = self.solve(frame, below)["body"]
        then = before[1][self.name]["body"].vertices
        return {"body": Shape(alone.rest, alone.vertices + 0.5 * then, alone.cells)}


def inner(fails=""):
    return [Stacked("bones"), Stacked("muscles", ("bones",), fails)]


def unreadable():
    raise InputError("rig.h5", "joints", "are not there", "Build it again")


class Slow(Stacked):
    """Writes who solves it, and waits to be killed."""

    def __init__(self, place):
        super().__init__("bones")
        self.place = place

    def solve(self, frame, below):
        if frame.name == "lift2":
            self.place.write_text(f"{os.getpid()}")
            time.sleep(60)
        return super().solve(frame, below)


def slow(place):
    return [Slow(place)]


def found(layers, ahead=None, **given):
    result = simulate(FRAMES, layers, follow=True, ahead=ahead, **given)
    heights = {
        frame.name: [float(s["body"].vertices[0, 0]) for s in shapes.values()]
        for frame, shapes in result.frames
    }
    return heights, result.failures


@pytest.mark.parametrize(("inner_fails", "fat_fails"), [("", ""), ("lift2", ""), ("", "lift3")])
def test_frames_are_the_same_as_in_one_process(inner_fails, fat_fails):
    """Also where a layer fails: layers under the fat go on from that frame, the fat from the one before."""
    fat = Stacked("fat", ("muscles",), fat_fails)
    together = found([*inner(inner_fails), fat])
    assert found([fat], partial(simulated_ahead, partial(inner, inner_fails))) == together
    assert [failure.frame for failure in together[1]] == [name for name in (inner_fails, fat_fails) if name]
    assert (
        found([*inner(), Stacked("fat", ("muscles",))])[0]["lift5"] != together[0]["lift5"] or not together[1]
    )


def test_kept_frames_are_where_the_other_process_begins():
    fat = Stacked("fat", ("muscles",))
    whole = simulate(FRAMES, [*inner(), fat], follow=True)
    done = {frame.name: (frame, shapes) for frame, shapes in whole.frames[:3]}
    again = simulate(FRAMES, [fat], done, follow=True, ahead=partial(simulated_ahead, inner))
    for (_, one), (_, other) in zip(whole.frames, again.frames, strict=True):
        assert all((one[name]["body"].vertices == other[name]["body"].vertices).all() for name in one)


def test_log_lines_come_with_their_frame(caplog):
    with caplog.at_level(logging.INFO):
        for (frame, _), asked in zip(simulated_ahead(inner, FRAMES[:2]), FRAMES, strict=False):
            said = [record.getMessage() for record in caplog.records if record.name == log.name]
            assert frame.name == asked.name and said[-1] == f"muscles of {asked.name}"
    assert "frame lift2: muscles in 0.0 s" in caplog.text


def test_layers_that_cannot_be_loaded_are_told_in_their_own_words():
    with pytest.raises(HandpipeError, match="^rig.h5: joints: are not there. Build it again$"):
        next(simulated_ahead(unreadable, FRAMES))


def test_a_process_that_is_killed_is_told_and_none_is_left(tmp_path):
    place = tmp_path / "process"
    given = simulated_ahead(partial(slow, place), FRAMES)
    assert not isinstance(next(given), Failure)
    while not place.exists() or not place.read_text():
        time.sleep(0.05)
    other = int(place.read_text())
    os.kill(other, signal.SIGKILL)
    with pytest.raises(ChildProcessError, match="ended before lift2"):
        next(given)
    with pytest.raises(ProcessLookupError):
        os.kill(other, 0)


def test_who_stops_asking_ends_the_process(tmp_path):
    place = tmp_path / "process"
    given = simulated_ahead(partial(slow, place), FRAMES)
    next(given)
    while not place.exists() or not place.read_text():
        time.sleep(0.05)
    given.close()
    with pytest.raises(ProcessLookupError):
        os.kill(int(place.read_text()), 0)


def test_attempts_are_made_when_they_are_asked_for():
    layers = inner()
    given = attempts(FRAMES, layers)
    assert next(given)[0].name == "lift1"
    layers[1].fails = "lift2"
    assert next(given) == Failure(
        "lift2", "muscles", "muscles did not converge: no equilibrium. See the log for its residuals."
    )
