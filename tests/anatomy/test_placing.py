"""Bones placed by clicks: middles of rays, ends of bones, rows, what is wrong; against formulas."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from handpipe.anatomy.placing import (
    BoneFile,
    bone_faults,
    load_bones,
    middle_inside,
    place_bones,
    read_library,
    write_bone_file,
)
from handpipe.anatomy.placing.templates import rod
from handpipe.anatomy.shipped import HAND
from handpipe.core import InputError
from handpipe.mesh.surfaces import Surface, concatenate

LIMB = trimesh.creation.capsule(height=160.0, radius=20.0, count=[48, 48])
SKIN = Surface(np.asarray(LIMB.vertices)[:, [2, 0, 1]], np.asarray(LIMB.faces))  # along x
LIBRARY = {"rod": rod()}


def ball(x: float, radius: float) -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    return Surface(np.asarray(mesh.vertices) + [x, 0, 0], np.asarray(mesh.faces))


def file(**bones: dict) -> BoneFile:
    return BoneFile.model_validate({"bones": bones})


def cylinder(*points: tuple[float, float, float], **more: object) -> dict:
    return {"kind": "cylinder", "points": points, **more}


@pytest.mark.parametrize("offset", [0.0, 3.0, 8.0])
def test_the_middle_of_a_ray_through_a_ball_is_the_foot_of_its_centre(offset: float) -> None:
    rng, skin = np.random.default_rng(0), ball(0.0, 10.0)
    for direction in rng.normal(size=(6, 3)):
        unit = direction / np.linalg.norm(direction)
        aside = np.cross(unit, rng.normal(size=3))
        aside *= offset / np.linalg.norm(aside)
        found = middle_inside(skin, aside - 50 * unit, 7 * direction, "bones.yaml")
        assert found == pytest.approx(aside, abs=0.05)


def test_only_the_first_way_through_counts_and_edges_are_met_once() -> None:
    two = concatenate([ball(0.0, 10.0), ball(40.0, 10.0)])
    assert middle_inside(two, np.array([-50.0, 0, 0]), np.array([1.0, 0, 0]), "f") == pytest.approx([0, 0, 0])
    cube = trimesh.creation.box((2, 4, 6))  # a ray along a diagonal of its faces meets four triangles
    box = Surface(np.asarray(cube.vertices), np.asarray(cube.faces))
    assert middle_inside(box, np.array([0.0, 0, 9]), np.array([0.0, 0, -1]), "f") == pytest.approx([0, 0, 0])


@pytest.mark.parametrize(
    ("direction", "problem"),
    [
        ((0, 1, 0), "does not go through the skin"),
        ((0, 0, 0), "no direction"),
        ((np.nan, 0, 0), "no direction"),
    ],
)
def test_a_click_beside_the_skin_is_refused(direction: tuple, problem: str) -> None:
    with pytest.raises(InputError, match=f"bones.yaml: click: .*{problem}"):
        middle_inside(ball(0.0, 10.0), np.array([-50.0, 0, 0]), np.array(direction, float), "bones.yaml")


@pytest.mark.parametrize(
    "ends", [((0, 0, 0), (60, 5, -9)), ((60, 0, 0), (-40, 0, 0)), ((0, 0, 0), (0, 0, 9))]
)
def test_a_long_bone_goes_from_end_to_end_with_its_radius(ends: tuple) -> None:
    bone = place_bones(file(femur=cylinder(*ends, radius=4.0)), LIBRARY, "f")["femur"]
    a, b = np.array(ends, float)
    axis = (b - a) / np.linalg.norm(b - a)
    along, radii = (bone.vertices - a) @ axis, np.linalg.norm(np.cross(bone.vertices - a, axis), axis=1)
    assert (along.min(), along.max()) == pytest.approx((0.0, np.linalg.norm(b - a)), abs=1e-9)
    assert radii.max() == pytest.approx(4.0) and bone.is_closed() and bone.volume() > 0


def test_a_shape_keeps_the_proportions_of_its_template() -> None:
    library = read_library([], HAND / "bones")
    bone = {"kind": "shape", "template": "capitate", "points": ((5.0, 0, 0), (5.0, 0, 14.0))}
    found, template = place_bones(file(patella=bone), library, "f")["patella"], library["capitate"]
    ratio = found.edge_lengths() / template.edge_lengths()
    assert ratio == pytest.approx(np.full(len(ratio), ratio[0]))
    assert found.vertices[:, 2].max() - found.vertices[:, 2].min() == pytest.approx(28.0)
    assert found.volume() == pytest.approx(template.volume() * ratio[0] ** 3)


def test_a_row_follows_its_curve_with_gaps() -> None:
    points = [(40 * np.cos(t), 40 * np.sin(t), 0.0) for t in np.linspace(0, np.pi / 2, 5)]
    row = {"kind": "curve", "points": points, "count": 6, "radius": 3.0}
    bones = place_bones(file(spine=row), LIBRARY, "f")
    assert list(bones) == [f"spine_{i}" for i in range(1, 7)]
    tips = np.array([b.vertices[[-2, -1]] for b in bones.values()])
    assert np.linalg.norm(tips, axis=2) == pytest.approx(40.0, abs=0.5)
    lengths = np.linalg.norm(tips[:, 1] - tips[:, 0], axis=1)
    assert lengths == pytest.approx(np.full(6, 0.9 * 2 * 40 * np.sin(np.pi / 24)), rel=0.01)
    assert bone_faults(file(spine=row), bones, ball(0.0, 60.0), "f") == []


def test_bones_outside_of_the_skin_and_in_one_another_are_named() -> None:
    given = file(
        inside=cylinder((-60, 0, 0), (-10, 0, 0)),
        out=cylinder((20, 0, 0), (150, 0, 0)),
        across=cylinder((-40, -12, 0), (-40, 12, 0), radius=2),
        within=cylinder((-58, 0, 0), (-50, 0, 0), radius=1),
    )
    found = {str(f) for f in bone_faults(given, place_bones(given, LIBRARY, "f"), SKIN, "bones.yaml")}
    assert len(found) == 3
    assert any("bones.out" in f and "% of it is outside the skin" in f for f in found)
    for other in ("across", "within"):
        assert any("bones.inside" in f and f"it and {other} penetrate" in f for f in found)


@pytest.mark.parametrize(
    ("bones", "message"),
    [
        ({"a": cylinder((0, 0, 0), (0.5, 0, 0))}, r"bones\.a\.points: two points are less than 1 mm apart"),
        (
            {"a": cylinder((0, 0, 0), (9, 0, 0), template="tail")},
            r"bones\.a\.template: 'tail' is no template",
        ),
        (
            {
                "a": {"kind": "curve", "points": ((0, 0, 0), (9, 0, 0)), "count": 2},
                "a_1": cylinder((0, 0, 0), (9, 0, 0)),
            },
            r"bones\.a_1: another bone is a_1",
        ),
    ],
)
def test_bones_that_cannot_be_made(bones: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        place_bones(file(**bones), LIBRARY, "bones.yaml")


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("bones: {a: {kind: cylinder, points: [[0, 0, 0]]}}", "points"),
        ("bones: {a: {kind: plate, points: [[0, 0, 0], [1, 0, 0]]}}", "bones.a"),
        ("bones: {'1 a': {kind: shape, points: [[0, 0, 0], [9, 0, 0]]}}", "bones"),
        ("units: cm", "units"),
        ("bones: {a: {kind: curve, points: [[0, 0, 0], [9, 0, .nan]]}}", "points"),
    ],
)
def test_files_that_are_wrong(tmp_path: Path, text: str, field: str) -> None:
    (tmp_path / "bones.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=f"bones.yaml: .*{field}.*See docs/how-to/place-bones.md"):
        load_bones(tmp_path / "bones.yaml")


def test_what_is_written_reads_as_the_same(tmp_path: Path) -> None:
    given = file(
        femur=cylinder((0, 0.125, 0), (60, 5, -9), radius=4.5),
        spine={"kind": "curve", "points": ((0, 0, 0), (9, 0, 0), (20, 1, 0)), "count": 3},
    )
    write_bone_file(tmp_path / "bones.yaml", given)
    assert load_bones(tmp_path / "bones.yaml") == given
