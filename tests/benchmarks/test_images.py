"""What the benchmark of the image model counts, and its regions in real images."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.images import calibration, document, rows
from benchmarks.images.subject import Setting

ROW = rows.Row("noise", "usual", 4, (0.98, 0.97), 0.1, [], [], 0, [], 1.0)


def test_silent_rows_are_counted_and_noticed_ones_are_not() -> None:
    wrong = replace(ROW, effect="coil", wrong=["distal2 (Dice 0.90, 0.30 mm)"])
    found = rows.figures([ROW, wrong, replace(wrong, silent=["distal2"])], [replace(wrong, silent=["x"])])
    assert found["image_effects"] == (2, "1")
    assert found["image_effects_silent"] == (1, "1")
    assert found["image_effects_silent_coarse"] == (1, "1")
    assert found["image_effects_wrong_bones"] == (2, "1")


def test_every_effect_has_a_row_of_each_strength_in_the_voxels_asked_for() -> None:
    found = [(effect, strength) for effect, strength, _ in rows.settings()]
    assert len(set(found)) == len(found)
    assert {(e, s) for e in rows.EFFECTS for s in ("usual", "severe")} < set(found)
    assert len(rows.EFFECTS) >= 15
    assert {setting.spacing for _, _, setting in rows.settings(0.9)} == {0.9}


def test_an_ideal_image_is_right_and_a_poor_one_is_noticed() -> None:
    right = rows.measure("none", "", Setting(spacing=0.8))
    assert right.dice is not None and right.dice[1] > 0.95 and not right.wrong
    refused = rows.measure("all", "usual", Setting(others="usual", spacing=1.2))
    assert refused.wrong and not refused.silent and refused.said
    assert "all" in document.rows_table(document.Table("abc", [right, refused]))


def test_the_width_of_an_edge_is_that_of_its_ramp() -> None:
    ramp = np.clip((np.arange(30.0) - 8.0) / 5.0, 0.0, 1.0)
    assert calibration.edge_width(ramp) == pytest.approx(4.0, abs=1e-9)


@pytest.mark.skipif(not calibration.DATA.exists(), reason="the shared real MRI is not beside the checkout")
def test_tissue_ratios_of_the_model_are_near_the_real_foot_and_hand() -> None:
    levels = [*calibration.real(), calibration.modelled("4.60", 0.7)]
    found = calibration.figures(levels)
    for tissue in ("marrow", "fat"):
        model, real = (found[f"image_{tissue}_over_muscle_4_60_{which}"][0] for which in ("model", "real"))
        assert 0.75 < model / real < 1.35
    muscle = [v.spread("muscle") for v in levels if v.echo == "4.60" and v.series != "calf_dixon"]
    assert max(muscle) < 4.0 * min(muscle)
