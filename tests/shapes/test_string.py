"""The one-dimensional string of Wang 2021 §5.9.5."""

import numpy as np
import pytest
from benchmarks.shapes import string
from benchmarks.shapes.string_theory import SLOPES, TARGETS, Slopes, logarithmic_1d, plastic_1d

CELLS = 24


def test_slopes_follow_the_marks_and_do_not_wiggle() -> None:
    fit = string.fitted(CELLS)
    assert string.buckled(fit) < 0.5
    positions = string.profile(fit, CELLS)
    assert positions[[0, -1]] == pytest.approx([0.0, 2.0], abs=0.001)
    assert string.slopes(positions) == pytest.approx([1.0, 5.0, 1.0], rel=0.001)
    assert (np.diff(positions) > 0).all()  # a variational curve folds over here
    middles = (np.arange(CELLS) + 0.5) / CELLS
    assert string.variational(3, middles).min() < 0
    ours, line = Slopes(np.diff(positions) * CELLS), logarithmic_1d(CELLS)
    assert ours.overshoot < Slopes(string.variational(3, middles)).overshoot
    assert ours.local.max() == pytest.approx(line.local.max(), rel=0.04)
    assert ours.local.min() == pytest.approx(line.local.min(), abs=0.02)


@pytest.mark.parametrize("cells", [16, 24])
def test_without_a_tube_the_string_buckles_and_the_fit_says_so(
    cells: int, caplog: pytest.LogCaptureFixture
) -> None:
    """Why its places along the line once had a peak slope of 7.5."""
    fit = string.fitted(cells, tube=0.0)
    assert string.buckled(fit) > 2.0
    assert fit.quality["attachments_bend"][0] > 0.02 * string.LENGTH
    assert "it may have buckled" in caplog.text


@pytest.mark.parametrize("cells", [16, 24])
def test_in_the_tube_nothing_is_said(cells: int, caplog: pytest.LogCaptureFixture) -> None:
    assert string.fitted(cells).quality["attachments_bend"][0] < 0.01 * string.LENGTH
    assert "buckled" not in caplog.text


@pytest.mark.parametrize("order", [1, 2, 3])
def test_variational_curves_meet_the_marks(order: int) -> None:
    fine = (np.arange(4000) + 0.5) / 4000
    positions = np.concatenate([[0.0], np.cumsum(string.variational(order, fine)) / 4000])
    assert positions[[1000, 2000, 4000]] == pytest.approx([0.25, 1.5, 2.0], abs=1e-4)


def test_stiff_elasticity_gives_the_natural_cubic_spline() -> None:
    """Its peak and least slope by hand: 128/23 and -17/23 (docs/shapes-string.md)."""
    errors = []
    for cells in (40, 80):
        local = plastic_1d(cells, 1e6).local
        errors.append([local.max() - 128 / 23, local.min() + 17 / 23])
    assert np.abs(errors[1]).max() < 0.01
    assert np.abs(errors[1]).max() < 0.6 * np.abs(errors[0]).max()


def test_soft_elasticity_gives_the_spline_of_roots() -> None:
    """Of the least integral of (h')^2, h^2 = x': cosines or hyperbolic cosines between marks."""
    local = plastic_1d(80, 1e-4).local
    roots = np.sqrt(local)
    ratio = (roots[2:] - 2 * roots[1:-1] + roots[:-2]) / roots[1:-1]  # h'' = mu h
    for inside in (ratio[:18], ratio[20:38], ratio[40:]):
        assert np.ptp(inside[1:-1]) < 0.02 * np.abs(ratio).max()


@pytest.mark.parametrize("stiffness", [1e6, 100.0, 30.0, 1.0, 0.01])
def test_no_elasticity_keeps_the_slopes_within_1_and_5(stiffness: float) -> None:
    curve = plastic_1d(40, stiffness)
    assert curve.missed < 1e-4
    assert curve.positions[-1] == pytest.approx(TARGETS[-1])
    assert curve.local.max() > SLOPES.max() + 0.5
    assert curve.overshoot > 0.2


def test_no_small_change_of_the_strains_is_better() -> None:
    """The objective of Wang 2021 Eq. 5.26, written once more, at the minimum that was found."""
    cells, beta, alpha = 40, 10.0, 1e4
    found = plastic_1d(cells, beta, alpha)
    c = found.elastic
    f = (1 - np.sqrt(1 - 4 * c * found.local)) / (2 * c)  # x' = f - c f^2

    def objective(f: np.ndarray) -> float:
        shift = (f.mean() - 2.0) / (f**2).mean()
        slope = f - shift * f**2
        x = np.concatenate([[0.0], np.cumsum(slope)]) / cells
        smooth = cells * float((np.diff(f) ** 2).sum())
        elastic = beta * float(((slope / f - 1) ** 2).mean())
        return smooth + elastic + alpha * ((x[cells // 4] - 0.25) ** 2 + (x[cells // 2] - 1.5) ** 2)

    least = objective(f)
    rng = np.random.default_rng(0)
    for _ in range(30):
        assert objective(f + 1e-3 * rng.normal(size=cells)) > least
