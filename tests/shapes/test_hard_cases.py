"""The hard cases of organs at small size: met, or noticed where nobody can know."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.shapes.hard_case_scenes import CASES
from benchmarks.shapes.hard_cases import ALARM, GOOD, MISSED, NOTICED, Row, judge, run
from tests.tissues.muscles.shapes import box

from handpipe.shapes.observations.marks import Pairs
from handpipe.shapes.observations.straight import in_space, loosened, on_line
from handpipe.shapes.organs.organ import OrganFit

EDGE = 4.0  # mm
FACETS = 0.1, 0.5  # mm by which the mean and the largest distance may be more than with small tets
# A right point at a tip may be left out with the wrong ones: said, and the shape is still near.
GENEROUS = ("attachment-off-8", "outliers-5", "outliers-20")
# One mark in a hundred at the disc's rim may be called far from the others (docs/hard-cases-shapes.md).
WARY = ("flat",)
SETTLED = [name for name, case in CASES.items() if not case.bars.unsettled]


def coarse(name: str) -> Row:
    case = CASES[name]
    bars = replace(case.bars, mean=case.bars.mean + FACETS[0], largest=case.bars.largest + FACETS[1])
    return run(replace(case, bars=bars), EDGE)


@pytest.mark.parametrize("name", SETTLED)
def test_hard_cases_are_met(name: str) -> None:
    row = coarse(name)
    allowed = {GOOD} | ({NOTICED} if name in GENEROUS else set()) | ({ALARM} if name in WARY else set())
    assert row.verdict in allowed, row
    assert row.mean < CASES[name].bars.mean + FACETS[0]


@pytest.mark.parametrize(
    ("name", "words"),
    [("contradicting", "contradict each other by"), ("outliers-20-trusted", "far from the others")],
)
def test_marks_that_cannot_all_be_right_are_noticed(name: str, words: str) -> None:
    row = coarse(name)
    assert row.verdict in (GOOD, NOTICED), row
    assert any(words in text for text in row.said)


def test_the_judge_believes_the_true_shape_alone() -> None:
    case = CASES["attachment-off-8"]
    scene = case.scene(EDGE)
    nothing = np.zeros(8, dtype=bool)
    named = np.arange(8) == scene.wrong_attachments[0]
    right = fit_of(scene.truth, named)
    assert judge(case, scene, right, 0.0).verdict == GOOD
    spike = scene.truth.vertices.copy()
    spike[scene.truth.boundary_vertices()[0]] += 10.0
    assert judge(case, scene, fit_of(scene.truth.moved(spike), nothing), 0.0).verdict == MISSED
    assert judge(case, scene, fit_of(scene.truth, nothing), 0.0).verdict == MISSED
    assert judge(case, scene, fit_of(scene.truth, ~named), 0.0).verdict == NOTICED
    plain = CASES["plain"].scene(EDGE)
    assert judge(CASES["plain"], plain, fit_of(plain.truth, named), 0.0).verdict == ALARM


def fit_of(mesh, doubtful) -> OrganFit:
    """A fit that found a mesh and doubts some attachments."""
    names = ("marks_weight", "marks_scatter", "marks_outlying", "marks_left_out")
    quality = dict(zip(names, [(1.0, "1"), (0.0, "mm"), (0.0, "1"), (0.0, "1")], strict=True))
    kept = np.ones(0, dtype=bool)
    return OrganFit(mesh, mesh, np.zeros((len(mesh.tets), 6)), mesh.vertices, [], kept, doubtful, quality)


def test_pairs_nearly_on_a_line_hold_the_line_and_speak_as_landmarks() -> None:
    points = np.array([[0.0, 0.0, 0.0], [10.0, 0.4, 0.0], [20.0, 0.0, 0.3]])
    assert on_line(points)
    attached, known = loosened(Pairs(points, points + [0.0, 5.0, 0.0]), None)
    assert attached is not None
    assert known is not None
    assert known.points == pytest.approx(points)
    across = np.linalg.svd(attached.targets - attached.targets.mean(axis=0), compute_uv=False)[1]
    assert across == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.norm(attached.points - points, axis=1).max() < 0.4
    wide = Pairs(points * [1, 10, 1], points * [1, 10, 1])
    assert loosened(wide, None) == (wide, None)


def test_points_in_a_plane_do_not_tell_uniform_strains() -> None:
    corners = box((1, 1, 1), (10.0, 10.0, 10.0)).vertices
    assert in_space(corners)
    assert not in_space(corners * [1.0, 1.0, 0.01])
    assert not in_space(corners[:3])
