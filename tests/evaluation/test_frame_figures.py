"""Figures of solvers reach the tables, the metrics and the warnings."""

import numpy as np
import pytest

from handpipe.core.layers import Frame, Shape
from handpipe.evaluation.frames import (
    figure_metrics,
    figure_names,
    frame_warnings,
    pose_metrics,
    pose_warnings,
    with_figures,
    worst_of,
)
from handpipe.hand.simulation import Failure

PLAIN = {"beyond": 0.0, "angle": "", "distance": 1.0, "nearest": "fist", "depth": 0.0, "bones": ""}


def body(**figures: float) -> Shape:
    return Shape(np.zeros((1, 3)), np.zeros((1, 3)), np.zeros((0, 3), int), figures=figures)


def rows() -> list[dict]:
    bare = [{"frame": name, **PLAIN} for name in ("good", "tangled", "lost")]
    bare[0] |= {"beyond": -12.5, "angle": "MP3_flexion", "depth": 0.4, "bones": "a b"}
    fine = {
        "muscles": {"m1": body(contact_motion=0.01, contact_unsettled=0.0)},
        "fat": {"fat": body(inverted_tets=0.0, least_det=0.3), "skin": body(skin_gap=0.1)},
    }
    bad = {
        "muscles": {
            "m1": body(contact_motion=0.01, contact_unsettled=0.0, cuts_itself=1.0),
            "m2": body(contact_motion=0.2, contact_unsettled=1.0, body_penetration=0.7),
        },
        "fat": {
            "fat": body(inverted_tets=2.0, least_det=-0.14, inner_overlap=1.6),
            "skin": body(skin_overlap=0.05, skin_crossings=7.0, skin_gap=0.0, bones_outside=0.6),
        },
        "tendons": {"t_centreline": body(compression=3.0)},
    }
    frames = [(Frame("good", {}, {}), fine), (Frame("tangled", {}, {}), bad)]
    first = with_figures(bare, frames[:1], [])
    return with_figures(first, frames[1:], [Failure("lost", "tendons", "Tendon x did not converge.")])


def test_rows_hold_the_worst_of_each_layers_bodies() -> None:
    good, tangled, lost = rows()
    assert tangled["muscles_contact_motion"] == 0.2 and tangled["muscles_contact_unsettled"] == 1.0
    assert (tangled["fat_inverted_tets"], tangled["fat_least_det"]) == (2.0, -0.14)
    assert good["fat_least_det"] == 0.3 and "fat_least_det" not in lost
    assert (lost["failed"], lost["reason"]) == ("tendons", "Tendon x did not converge.")


def test_metrics_are_the_worst_over_frames() -> None:
    metrics = figure_metrics(rows(), figure_names(rows(), ["frame", *PLAIN]))
    assert metrics == {
        "frames_failed": (1.0, "frames"),
        "muscles_contact_motion": (0.2, "mm"),
        "muscles_contact_unsettled": (1.0, "1"),
        "fat_inverted_tets": (2.0, "tets"),
        "fat_least_det": (-0.14, "1"),
        "fat_inner_overlap": (1.6, "mm"),
        "muscles_cuts_itself": (1.0, "1"),
        "muscles_body_penetration": (0.7, "mm"),
        "fat_skin_overlap": (0.05, "mm"),
        "fat_skin_crossings": (7.0, "1"),
        "fat_skin_gap": (0.0, "mm"),
        "fat_bones_outside": (0.6, "mm"),
        "tendons_compression": (3.0, "1"),
    }


def test_warnings_name_frame_layer_and_size() -> None:
    assert frame_warnings("close", rows()) == [
        "Scene close: outside the range of the scans: good (MP3_flexion by -12.5 deg).",
        "Scene close: bones penetrate each other: good (a b, 0.40 mm).",
        "Scene close: contact has not settled: tangled (muscles).",
        "Scene close: an organ folds into itself: tangled (muscles).",
        "Scene close: organs lie in bones or in one another: tangled (muscles: 0.70 mm).",
        "Scene close: inverted tets are handed on: tangled (fat: 2, least det F -0.14).",
        "Scene close: tissue penetrates the organs inside: tangled (fat: 1.60 mm).",
        "Scene close: the skin penetrates itself: tangled (fat: 0.05 mm).",
        "Scene close: the skin crosses itself: tangled (fat: 7 edges through triangles).",
        "Scene close: bones come through the skin: tangled (fat: 0.60 mm).",
        "Scene close: tendons are compressed and folded: tangled (3.0 of the pull).",
        "Scene close: not simulated and left out: lost (tendons: Tendon x did not converge).",
    ]
    assert frame_warnings("close", [{"frame": "good", **PLAIN, "fat_inverted_tets": 0.0}]) == []


def fits() -> list[dict]:
    """Two fits to scans, the second neither settled nor upright."""
    good = {
        "unsettled": 0.0,
        "contact_motion": 0.004,
        "residual": 0.02,
        "inverted_tets": 0.0,
        "least_det": 0.4,
        "unfinished": 0.0,
        "mean_gap": 0.021,
    }
    bad = {"unsettled": 1.0, "contact_motion": 0.08, "residual": 0.5, "inverted_tets": 1.0, "least_det": -0.2}
    bad |= {"unfinished": 1.0, "mean_gap": 0.057}
    return [
        {"frame": pose, **worst_of({"fat_fit": [figures]})}
        for pose, figures in (("bow", good), ("fist", bad))
    ]


def test_poses_have_their_own_figures_beside_the_worst() -> None:
    metrics = pose_metrics(fits())
    assert metrics["fat_fit_contact_motion"] == metrics["fat_fit_contact_motion_fist"] == (0.08, "mm")
    assert metrics["fat_fit_contact_motion_bow"] == (0.004, "mm")
    assert metrics["fat_fit_least_det"] == (-0.2, "1") != metrics["fat_fit_least_det_bow"]
    assert metrics["fat_fit_residual_bow"] == (0.02, "mN")
    assert metrics["fat_fit_mean_gap_bow"] == (0.021, "mm")
    assert len(metrics) == 21


def test_warnings_of_fits_name_the_pose_once() -> None:
    rows = fits()
    rows[0] |= {"fat_fit_tangles": 2.0, "muscles_tangles": 0.0}
    rows[1] |= {"fat_unsettled": 1.0, "fat_contact_unsettled": 1.0}
    assert pose_warnings(rows) == [
        "Scanned poses: tangles are left: bow (fat_fit: 2).",
        "Scanned poses: contact has not settled: fist (fat_fit), fist (fat).",
        "Scanned poses: inverted tets are handed on: fist (fat_fit: 1, least det F -0.2).",
        "Scanned poses: the fit to the scan has not converged: fist (skin 0.06 mm from it in the mean).",
    ]


def test_a_fit_that_stops_within_a_scan_s_noise_is_no_doubt() -> None:
    row = {"frame": "curl", "fat_fit_unfinished": 1.0, "fat_fit_mean_gap": 0.013}
    assert pose_warnings([row]) == []
    [said] = pose_warnings([row | {"fat_fit_mean_gap": 0.031}])
    assert said.startswith("Scanned poses: the fit to the scan has not converged: curl")


@pytest.mark.parametrize(
    "name", ["fat_inverted_tets", "fat_skin_overlap", "fat_skin_crossings", "fat_unsettled", "fat_tangles"]
)
def test_a_figure_that_is_no_number_is_a_warning(name: str) -> None:
    assert len(frame_warnings("close", [{"frame": "odd", **PLAIN, name: np.nan}])) == 1
