"""The report names bones that are left out, and bones of few voxels."""

from handpipe.evaluation import bone_warnings, looks_figures
from handpipe.imaging.segmentation import Appearance


def look(width):
    return Appearance(
        30.0, border=0.2, level=1.0, relative_level=1.0, enclosed=1.0, cut_off=False, width=width
    )


def test_thin_bones_of_neutral_are_counted_and_named():
    looks = {"neutral": {"distal5": look(2.7), "middle5": look(4.1)}, "fist": {"distal5": look(2.6)}}
    figures = looks_figures(looks, {"neutral": {}, "fist": {"middle5": "no strokes"}}, "neutral")
    assert figures["thin_bones"] == (1, "1") and figures["marrow_width_distal5"] == (2.7, "1")
    gone, thin = bone_warnings(figures)
    assert "in some pose: 1" in gone and "distal5 (2.7)" in thin and "middle5" not in thin


def test_right_bones_are_not_named():
    looks = {"neutral": {"distal5": look(4.0)}}
    assert bone_warnings(looks_figures(looks, {"neutral": {}}, "neutral")) == []
