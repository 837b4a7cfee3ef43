"""Tables against the numbers of the papers."""

import numpy as np
import pytest

from handpipe.evaluation import table

# Zheng 2022, Table 4: average, median and max of m0 and m2 of poses 2, 3 and 4
PAPER = {
    "2": {"m0": (0.23, 0.13, 2.42), "m2": (1.35, 1.22, 4.70)},
    "3": {"m0": (0.14, 0.08, 2.72), "m2": (1.19, 0.88, 6.34)},
    "4": {"m0": (0.11, 0.07, 2.59), "m2": (1.31, 0.86, 7.09)},
}


def with_statistics(mean: float, median: float, largest: float) -> np.ndarray:
    """Seven distances that have just these statistics."""
    low = np.zeros(3)
    high = np.full(2, (7 * mean - median - largest) / 2)
    return np.concatenate([low, [median], high, [largest]])


def test_totals_follow_the_papers_rule():
    distances = {
        f"pose{p}": {m: with_statistics(s[0] + 2, s[1], s[2] + 9) for m, s in models.items()}
        for p, models in PAPER.items()
    }
    metrics = table.skin_metrics(table.skin_rows(distances, dict.fromkeys(distances, "example")))
    assert metrics["skin_pose3_m2_mean"] == (pytest.approx(3.19), "mm")
    assert metrics["skin_pose3_m2_median"][0] == pytest.approx(0.88)
    assert metrics["skin_all_m0_mean"][0] == pytest.approx(2 + (0.23 + 0.14 + 0.11) / 3)
    assert metrics["skin_all_m0_median"][0] == pytest.approx(0.08)
    assert metrics["skin_all_m2_max"][0] == pytest.approx(16.09)


def test_skin_table_has_totals_by_role_and_leaves_out_what_is_missing():
    distances = {"fist": {"m0": np.array([1.0, 2.0, 6.0])}, "half": {"m0": np.array([3.0, 4.0, 5.0])}}
    made = table.skin_table(table.skin_rows(distances, {"fist": "example", "half": "heldout"}))
    assert made is not None
    assert list(made.columns) == ["pose", "mean m0 [mm]", "median m0 [mm]", "max m0 [mm]"]
    assert [list(r) for r in made.rows] == [
        ["fist (example)", 3.0, 2.0, 6.0],
        ["half (heldout)", 4.0, 4.0, 5.0],
        ["example", 3.0, 2.0, 6.0],
        ["heldout", 4.0, 4.0, 5.0],
        ["all", 3.5, 3.0, 6.0],
    ]
    assert table.skin_table([]) is None


def test_muscle_table_has_a_row_a_muscle_and_a_column_a_pose():
    rows = [
        {"muscle": "adductor", "pose": "fist", "role": "example", "mean": 0.2, "median": 0.1, "max": 0.9},
        {"muscle": "adductor", "pose": "hook", "role": "heldout", "mean": 0.4, "median": 0.1, "max": 0.9},
        {"muscle": "opponens", "pose": "fist", "role": "example", "mean": 0.6, "median": 0.1, "max": 0.9},
    ]
    made = table.muscle_table(rows)
    assert made is not None
    assert list(made.columns) == ["muscle", "fist (example)", "hook (heldout)"]
    assert [list(r) for r in made.rows] == [
        ["adductor", 0.2, 0.4],
        ["opponens", 0.6, None],
        ["average", pytest.approx(0.4), pytest.approx(0.4)],
    ]
    assert table.muscle_table([]) is None


def test_rig_table_has_the_papers_columns_and_the_average_last():
    made = table.rig_table(
        [
            {"joint": "DIP2", "FM_R": 2.10, "FM_x": 0.31, "PM_R": 3.25, "PM_x": 0.40},
            {"joint": "PIP2", "FM_R": 1.90, "FM_x": 0.32, "PM_R": 2.08, "PM_x": 0.36},
        ]
    )
    assert made is not None
    assert list(made.columns) == ["joint", "FM_R [deg]", "FM_x [mm]", "PM_R [deg]", "PM_x [mm]"]
    assert list(made.rows[0]) == ["DIP2", 2.10, 0.31, 3.25, 0.40]
    assert made.rows[-1][0] == "average"
    assert list(made.rows[-1][1:]) == pytest.approx([2.0, 0.315, 2.665, 0.38])


def test_metrics_with_a_poses_name_become_columns():
    metrics = {
        "dice_fist": (0.9, "1"),
        "dice_bow": (0.8, "1"),
        "dice_oppose_little_distal2": (0.7, "1"),
        "rms_fist_mean": (0.1, "mm"),
        "seconds": (3, "s"),
    }
    made = table.metrics_table("stage", metrics, ["bow", "fist", "oppose_little"])
    assert list(made.columns) == ["measure", "unit", "overall", "bow", "fist", "oppose_little"]
    assert [list(r) for r in made.rows] == [
        ["dice", "1", "", "0.8", "0.9", ""],
        ["dice distal2", "1", "", "", "", "0.7"],
        ["rms mean", "mm", "", "", "0.1", ""],
        ["seconds", "s", "3", "", "", ""],
    ]


def test_html_escapes_names():
    html = table.Table("a < b", ["x & y", "z"], [["<script>", 1.234]]).html()
    assert "<script>" not in html and "a &lt; b" in html and "x &amp; y" in html and "<td>1.23</td>" in html


def test_a_column_has_the_decimals_in_which_its_numbers_differ():
    """As a person reads them: no two different numbers alike, none that is not zero as zero."""
    made = table.Table(
        "t",
        ["pose", "a [deg]", "b [mm]", "c [mm]", "d [s]"],
        [["p", 1.0, 0.2600, 0.2649, 0.0004], ["q", 2.0, 0.5, 0.6, 12.0], ["r", None, "text", 0.60001, 0.0]],
    )
    assert made.decimals() == [2, 2, 3, 3, 4]
    text = made.html()
    assert "<td>0.260</td><td>0.265</td><td>0.0004</td>" in text and "<td>1.00</td>" in text
    assert table.Table("t", ["x", "a"], [["p", 1e-12], ["q", float("nan")]]).decimals() == [6, 6]
