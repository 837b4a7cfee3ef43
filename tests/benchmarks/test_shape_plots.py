"""Plots of organs' fits: what they show is measured on the fit, whatever the search says of itself."""

from pathlib import Path

import numpy as np
import pytest
from benchmarks.shapes import plots
from benchmarks.shapes.bodies import liver, scattered
from benchmarks.shapes.comparison_bodies import BODIES
from benchmarks.shapes.organs import extremes, grown_liver
from benchmarks.shapes.plots import ANGLES, ERRORS, Followed
from PIL import Image


@pytest.fixture(scope="module")
def followed() -> Followed:
    mesh = liver(40.0)
    wanted = grown_liver(mesh, 0.5)
    return Followed.fit(mesh, scattered(wanted.boundary(), 40), None, extremes(mesh, wanted))


def test_the_objective_falls_and_marks_are_met(followed: Followed) -> None:
    assert followed.objectives[-1] < 0.01 * followed.objectives[0]
    assert len(followed.errors) == 40
    assert followed.errors.max() < 1.0
    assert followed.before.min() == pytest.approx(liver(40.0).smallest_dihedral())
    assert followed.after.min() > 0


def test_shares_are_of_all_marks_and_tets(followed: Followed) -> None:
    figures = {key: entry["value"] for key, entry in followed.figures("liver").items()}
    for name, limits in (("errors", ERRORS), ("angles_before", ANGLES), ("angles_after", ANGLES)):
        shares = [figures[f"plots_liver_{name}_{k:02d}"] for k in range(len(limits) - 1)]
        assert sum(shares) == pytest.approx(100.0)
    assert figures["plots_liver_objective_00"] == 1.0
    sharp = sum(figures[f"plots_liver_angles_after_{k:02d}"] for k in range(4))
    assert sharp == pytest.approx(100 * (followed.after < ANGLES[4]).mean())


def test_the_picture_shows_bodies_and_curves(followed: Followed, tmp_path: Path) -> None:
    figures = {k: v for name in plots.LINES for k, v in followed.figures(name).items()}
    shapes = {name: dict.fromkeys(plots.TOLD, BODIES[name](0).truth) for name in BODIES}
    plots.draw(tmp_path / "plots.png", figures, shapes)
    pixels = np.asarray(Image.open(tmp_path / "plots.png").convert("RGB")).astype(int)
    upper, lower = np.array_split(pixels, 2)
    flesh = (upper[..., 0] > upper[..., 1] + 40).any(axis=0)
    assert flesh.sum() > 400
    assert (np.ptp(lower, axis=2) > 60).any(axis=0).sum() > 300
