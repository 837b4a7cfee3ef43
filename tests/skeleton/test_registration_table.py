"""Figures of registration against numbers written out, and calibration against draws from what is stated."""

import numpy as np
import pytest
from manufactured import noisy

from handpipe.core.rigid import RigidTransform
from handpipe.skeleton.bones.registration_result import Registration
from handpipe.skeleton.registration.registration_table import registration_figures, registration_rows

COVARIANCE = np.diag([np.radians(0.2) ** 2] * 3 + [0.03**2] * 3)


def rows_of_draws(degrees, count=400):
    """Registrations that are off by normal errors of so many degrees and 0.03 mm, each component."""
    rng, rows = np.random.default_rng(0), []
    for i in range(count):
        found = noisy(RigidTransform.identity(), rng, degrees, 0.03)
        angle = float(np.degrees(found.angle_to(RigidTransform.identity())))
        error = (angle, float(np.linalg.norm(found.translation)))
        rows += registration_rows(f"p{i}", {"a": Registration(found, 0.02, COVARIANCE)}, {"a": error})
    return rows


@pytest.mark.parametrize(("degrees", "ratio"), [(0.2, 1.0), (0.6, 3.0)])
def test_calibration_is_the_ratio_of_errors_to_deviations(degrees, ratio):
    figures = registration_figures(rows_of_draws(degrees), [])
    assert figures["rotation_error_by_deviation"][0] == pytest.approx(ratio, rel=0.06)
    assert figures["translation_error_by_deviation"][0] == pytest.approx(1.0, rel=0.06)
    within = figures["rotation_error_within_two_deviations"][0]
    assert within > 0.98 if ratio == 1.0 else within < 0.5


def test_bones_in_doubt_are_counted_and_not_averaged():
    good = Registration(RigidTransform.identity(), 0.02, COVARIANCE)
    wrong = Registration(RigidTransform.identity(), 0.4, COVARIANCE, doubt="its joint is open")
    rows = registration_rows("fist", {"a": good, "b": wrong}, {"a": (0.1, 0.01), "b": (90.0, 20.0)})
    figures = registration_figures(rows, [("fist", "c")])
    assert figures["rotation_error_max"] == (0.1, "deg") and figures["translation_error_mean"] == (0.01, "mm")
    assert figures["doubtful_bones"] == (1, "1") and figures["missing_bones"] == (1, "1")
    assert figures["doubtful_fist_b"] == (1, "1") and figures["missing_fist_c"] == (1, "1")
    assert figures["rotation_deviation_fist_a"][0] == pytest.approx(0.2 * np.sqrt(3))
    assert figures["translation_deviation_max"][0] == pytest.approx(0.03 * np.sqrt(3))
    assert rows[1]["doubt"] == "its joint is open"


def test_without_truth_there_are_no_errors():
    good = Registration(RigidTransform.identity(), 0.02, COVARIANCE)
    figures = registration_figures(registration_rows("fist", {"a": good}, {}), [])
    assert not any("error" in name for name in figures)
    assert "rotation_deviation_max" in figures
