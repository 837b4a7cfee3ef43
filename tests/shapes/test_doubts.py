"""What points say of each other: predictions without a point are those of the fit without it."""

import numpy as np
import pytest
from tests.tissues.muscles.shapes import box

from handpipe.shapes.observations.attached import Attached
from handpipe.shapes.observations.attachment_targets import AttachmentTargets
from handpipe.shapes.observations.marks import BoundaryMarks, Pairs
from handpipe.shapes.optimisation.all_tets import AllTets
from handpipe.shapes.optimisation.search import Search
from handpipe.shapes.optimisation.settings import OrganSettings
from handpipe.shapes.organs.coarse_template import WORTH, coarsened
from handpipe.shapes.organs.doubts import examine
from handpipe.shapes.organs.predictions import Predictions
from handpipe.shapes.organs.remeshing import Given

MESH = box((5, 2, 2), (30.0, 10.0, 8.0))
RNG = np.random.default_rng(0)
OUTER = MESH.vertices[RNG.choice(MESH.boundary_vertices(), 24, replace=False)]


def grown(points: np.ndarray) -> np.ndarray:
    return points * [1.1, 1.2, 0.9] + 0.01 * np.stack(
        [0 * points[:, 0], points[:, 0] ** 2, 0 * points[:, 0]], 1
    )


def given(marks: np.ndarray, attachments: Pairs | None) -> Given:
    attached = None if attachments is None else attachments.attached(MESH)
    return Given(MESH, marks, attached, None, (), None, OrganSettings())


def test_errors_are_those_of_a_model_without_the_point() -> None:
    attached = Pairs(OUTER[:6], grown(OUTER[:6])).attached(MESH)
    marks = BoundaryMarks(MESH, grown(OUTER[6:]), 0.1)
    space = AllTets(MESH.tets, OrganSettings())
    free = AttachmentTargets.place(Attached.nothing(len(MESH.vertices)), (), MESH.vertices)
    state = Search(MESH, space, OrganSettings()).begin(free, MESH.vertices)
    predictions = Predictions.at(space, state, marks, None, attached)
    found = predictions.errors(predictions.attachments, predictions.points, 0.5)
    gram, free, wanted = predictions._gram, predictions._free, predictions._wanted
    weak = np.diag(1 / np.sqrt(predictions._ridge))
    covariance = gram + (free @ weak) @ (free @ weak).T
    for point, offset in zip(predictions.attachments, found, strict=True):
        own = np.arange(3 * point, 3 * point + 3)
        others = np.setdiff1d(np.arange(len(wanted)), own)
        noisy = covariance[np.ix_(others, others)] + 2.0 * np.eye(len(others))
        predicted = covariance[np.ix_(own, others)] @ np.linalg.solve(noisy, wanted[others])
        assert wanted[own] - predicted == pytest.approx(offset, abs=1e-3 * np.abs(wanted).max())


@pytest.mark.parametrize("wrong", [None, 3])
def test_the_attachment_that_is_wrong_is_named(wrong: int | None) -> None:
    targets = grown(OUTER[:6])
    if wrong is not None:
        targets[wrong] += [0.0, 6.0, -5.0]
    doubts = examine(given(grown(OUTER[6:]), Pairs(OUTER[:6], targets)), MESH.vertices)
    assert np.flatnonzero(doubts.attachments).tolist() == ([] if wrong is None else [wrong])


@pytest.mark.parametrize(("marks", "attached"), [(1, 0), (3, 0), (0, 1), (0, 3), (2, 2), (0, 5)])
def test_few_points_raise_no_doubts(marks: int, attached: int) -> None:
    pairs = Pairs(OUTER[:attached], grown(OUTER[:attached])) if attached else None
    doubts = examine(given(grown(OUTER[12 : 12 + marks]), pairs), MESH.vertices)
    assert not doubts.attachments.any()
    assert doubts.share == 1.0
    assert doubts.outlying == 0.0


def test_few_tets_carry_the_points_of_many() -> None:
    fine = box((20, 9, 8), (30.0, 10.0, 8.0))
    coarse, carry = coarsened(fine)
    assert len(coarse.tets) < len(fine.tets) / WORTH
    assert carry @ grown(coarse.vertices) == pytest.approx(grown(fine.vertices), abs=0.03)


def test_the_wrong_attachment_is_named_among_many_tets_too() -> None:
    fine = box((20, 9, 8), (30.0, 10.0, 8.0))
    targets = grown(OUTER[:6])
    targets[3] += [0.0, 6.0, -5.0]
    attached = Pairs(OUTER[:6], targets).attached(fine)
    marks = grown(OUTER[6:])
    doubts = examine(Given(fine, marks, attached, None, (), None, OrganSettings()), fine.vertices)
    assert np.flatnonzero(doubts.attachments).tolist() == [3]
