"""Layers are solved inside out, each from those it needs."""

import logging

import numpy as np
import pytest

from handpipe.errors import ConvergenceError
from handpipe.hand.simulation import simulate, simulate_frame
from handpipe.layers import Frame, Shape


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


def test_a_layer_that_the_subject_lacks_is_no_obstacle():
    fat = _Shifted("fat", ("bones", "tendons"))
    simulate_frame(_frame(0.0), [_Shifted("bones", ()), fat])
    assert fat.saw == [{"bones"}]


def test_frames_do_not_depend_on_one_another():
    layers = [_Shifted("bones", ()), _Shifted("fat", ("bones",))]
    together = simulate([_frame(1.0), _frame(2.0), _frame(3.0)], layers)
    [(frame, alone)] = simulate([_frame(2.0)], layers)
    assert [f.name for f, _ in together] == ["lift1.0", "lift2.0", "lift3.0"]
    assert frame.name == "lift2.0"
    np.testing.assert_array_equal(together[1][1]["fat"]["body"].vertices, alone["fat"]["body"].vertices)


def test_a_layer_without_equilibrium_stops_the_frame():
    with pytest.raises(ConvergenceError, match="fat"):
        simulate_frame(_frame(0.0), [_Shifted("bones", ()), _Broken("fat", ("bones",))])


def test_progress_is_logged(caplog):
    with caplog.at_level(logging.INFO, logger="handpipe.hand.simulation"):
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
