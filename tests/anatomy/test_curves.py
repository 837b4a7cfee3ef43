"""Files of curves: what they may say, what is refused, and where points come to lie."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from tests.anatomy.arm import THREE_MUSCLES, capsule

from handpipe.anatomy.templates.curves import (
    CurveFile,
    catmull_rom,
    load_curves,
    long_axis,
    place,
    sunken,
)
from handpipe.core.errors import InputError
from handpipe.mesh.surfaces.curves import arclength
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface


@pytest.fixture(scope="module")
def bone() -> Surface:
    return capsule(-30.0, 30.0, 5.0, 3.0)


def one_curve(*points: dict, **more: object) -> CurveFile:
    return CurveFile.model_validate({"muscles": {"m": {"curves": [{"points": points, **more}]}}})


def on_bone(along: float, towards: list[float], **more: object) -> dict:
    return {"bone": "radius", "along": along, "towards": towards, **more}


def test_points_on_bones_lie_on_their_surfaces(bone: Surface) -> None:
    file = one_curve(on_bone(0.2, [0, 1, 0]), {"at": [0, 12, 0]}, on_bone(0.8, [0, 1, 1], height=2.0))
    points = place(file, {"radius": bone}, 1.0)["m"].curves[0].points
    distance = Distance(bone).signed(points[[0, -1]])[0]
    np.testing.assert_allclose(distance, [0, 2], atol=0.05)
    assert abs(points[0, 0] + 0.3 * 70) < 0.5 and abs(points[-1, 0] - 0.3 * 70) < 0.5
    assert abs(np.linalg.norm(points - [0, 12, 0], axis=1).min()) < 0.5
    assert arclength(points)[-1] > 42 and np.linalg.norm(np.diff(points, axis=0), axis=1).max() < 1.01


def test_points_move_with_their_bone(bone: Surface) -> None:
    """The same file on a bone elsewhere and twice as large."""
    file = one_curve(on_bone(0.2, [0, 1, 0]), on_bone(0.8, [0, 0, 1]))
    here = place(file, {"radius": bone}, 1.0)["m"].curves[0].points[[0, -1]]
    there = (
        place(file, {"radius": bone.moved(2 * bone.vertices + [5, 6, 7])}, 1.0)["m"].curves[0].points[[0, -1]]
    )
    np.testing.assert_allclose(there, 2 * here + [5, 6, 7], atol=1e-9)


def test_long_axis_points_to_the_distal_side(bone: Surface) -> None:
    for sign in (1, -1):
        axis, start, end = long_axis(bone, np.array([sign, 0.2, 0]))
        np.testing.assert_allclose(axis, [sign, 0, 0], atol=0.01)
        np.testing.assert_allclose((end - start) @ axis, 70, atol=0.5)


def test_spline_meets_its_points_and_does_not_overshoot() -> None:
    points = np.array([[0, 0, 0], [10, 0, 0], [10.1, 0.1, 0], [10.1, 10, 0]])
    knots, spline = catmull_rom(points)
    np.testing.assert_allclose(spline(knots), points, atol=1e-12)
    fine = spline(np.linspace(0, knots[-1], 500))
    assert fine[:, 0].max() < 10.6 and fine[:, 1].min() > -0.5


def test_a_curve_between_two_points_on_a_bone_runs_as_deep_as_the_chord() -> None:
    """The bone is round there, with a radius of 5 mm: a chord of 90 degrees runs 5 (1 - cos 45) mm deep."""
    bone = capsule(-10.0, 10.0, 5.0, 1.0)
    (curve,) = one_curve(on_bone(0.5, [0, 1, 0]), on_bone(0.5, [0, 0, 1])).muscles["m"].curves
    depth = sunken(curve.points, {"radius": bone}, (1, 0, 0), "file", "curve")
    np.testing.assert_allclose(depth, 5 * (1 - np.cos(np.pi / 4)), atol=0.05)


def test_a_curve_off_its_bone_or_from_bone_to_bone_is_not_sunken(bone: Surface) -> None:
    other = {"bone": "ulna", "along": 0.5, "towards": [0, 1, 0]}
    points = [on_bone(0.4, [0, 1, 0], height=3.0), on_bone(0.6, [0, 1, 0], height=3.0), other]
    (curve,) = one_curve(*points).muscles["m"].curves
    bones = {"radius": bone, "ulna": bone.moved(bone.vertices - [0, 20, 0])}
    np.testing.assert_array_equal(sunken(curve.points, bones, (1, 0, 0), "file", "curve"), [0, 0])


def test_tissue_and_spread_are_interpolated_without_overshoot(bone: Surface) -> None:
    points = [
        {"at": [0, 10, 0], "tissue": 1, "spread": [1, 1]},
        {"at": [10, 10, 0], "tissue": 3, "spread": [4, 1]},
        {"at": [20, 10, 0], "tissue": 3, "spread": [4, 1]},
    ]
    curve = place(one_curve(*points, normal=[0, 0, 1]), {}, 0.5)["m"].curves[0]
    assert curve.tissue[0] == 1 and curve.tissue.max() == 3 and (np.diff(curve.tissue) >= -1e-12).all()
    np.testing.assert_allclose(curve.rates[[0, -1]], [[1, 1, 1], [1, 4, 1]])
    np.testing.assert_allclose(curve.frames[0], [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=0.05)


def test_several_curves_and_attachments(bone: Surface) -> None:
    content = yaml.safe_load(THREE_MUSCLES)
    flexor = content["muscles"]["flexor"]
    flexor["curves"].append({"points": [on_bone(0.15, [0, 1, -1]), on_bone(0.85, [0, 1, -1])]})
    sheet = [on_bone(0.1, [0, -1, -1]), on_bone(0.3, [0, -1, -1])]
    flexor["attachments"] = [{"end": "origin", "points": sheet, "reach": 2}]
    muscle = place(CurveFile.model_validate(content), {"radius": bone}, 1.0)["flexor"]
    assert [len(muscle.curves), len(muscle.origins), len(muscle.insertions)] == [2, 3, 2]
    assert muscle.origins[2].reach == 2 and len(muscle.origins[2].points) == 2


GOOD = THREE_MUSCLES


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("units: mm", "units: cm", "units"),
        ("fat: 0.3", "fat: -1", "fat"),
        ("fat: 0.3", "fats: 0.3", "fats"),
        ("tissue: 1.5", "tissue: 0", r"muscles.flexor.curves.0.points.1.tissue"),
        ("{at: [0, 0, -12],", "{at: [0, 0, -12], bone: radius,", r"muscles.flexor.curves.0.points.1"),
        ("{at: [0, 0, -12],", "{at: [0, -12],", r"muscles.flexor.curves.0.points.1.at"),
        ("{at: [0, 0, -12],", "{bone: radius, along: 0.5,", "towards"),
        ("{at: [0, 0, -12], tissue: 1.5}", "{at: [0, 0, -12], spread: [1, 2]}", "normal"),
        ("along: 0.1", "along: 1.1", "along"),
        ("muscles:", "muscles", "YAML"),
    ],
)
def test_wrong_files_are_refused_by_file_and_field(tmp_path: Path, old: str, new: str, field: str) -> None:
    path = tmp_path / "curves.yaml"
    path.write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=field) as caught:
        load_curves(path)
    assert str(path) in str(caught.value) and "docs/anatomy.md" in str(caught.value)


def test_good_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "curves.yaml"
    path.write_text(GOOD, encoding="utf-8")
    assert list(load_curves(path).muscles) == ["flexor", "extensor", "abductor"]


@pytest.mark.parametrize(
    ("points", "more", "problem"),
    [
        (({"bone": "ulna", "towards": [0, 0, 1]}, {"at": [0, 0, 9]}), {}, "points.0.bone.*ulna"),
        ((on_bone(0.9, [1, 1e-3, 0]), {"at": [0, 0, 9]}), {}, "points.0.*misses"),
        (({"at": [0, 0, 9]}, {"at": [0, 0, 9]}), {}, "same place"),
        (({"at": [0, 0, 9]}, {"at": [9, 0, 9]}), {"normal": [1, 0, 0]}, "normal"),
    ],
)
def test_points_that_cannot_be_placed_are_named(
    bone: Surface, points: tuple, more: dict, problem: str
) -> None:
    half = Surface(bone.vertices, bone.triangles[bone.vertices[bone.triangles, 0].max(axis=1) < 0])
    with pytest.raises(InputError, match=problem):
        place(one_curve(*points, **more), {"radius": half}, 1.0, "hand.yaml")
