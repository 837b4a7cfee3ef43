"""The page of handpipe bones in a real browser: clicks through the skin, drag, undo, save, what is wrong."""

import json
import shlex
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
from tests.browser import chromium, needs_browser, opened, settled

from handpipe.anatomy.placing import load_bones
from handpipe.cli import main
from handpipe.cli.muscle_curves import BoneServer, BoneSession, curves_command, open_bones
from handpipe.core import InputError
from handpipe.mesh.files import read_surface, write_surface
from handpipe.mesh.surfaces import Surface

PAGE = "document.querySelector('main').page"
LIMB = trimesh.creation.capsule(height=160.0, radius=20.0, count=[32, 32])
SKIN = Surface(np.asarray(LIMB.vertices)[:, [2, 0, 1]], np.asarray(LIMB.faces))  # along x


@pytest.fixture
def skin(tmp_path: Path) -> Path:
    write_surface(tmp_path / "skin.ply", SKIN)
    return tmp_path / "skin.ply"


@pytest.fixture(scope="module")
def browser() -> Iterator:
    yield from chromium()


@pytest.fixture
def session(skin: Path) -> BoneSession:
    return open_bones(skin.with_name("limb.yaml"), skin)


@pytest.fixture
def page(browser, session: BoneSession) -> Iterator:
    with opened(browser, BoneServer(session)) as shown:
        yield shown


def on_page(page, place: tuple[float, float, float]) -> tuple[float, float]:
    x, y = page.evaluate(f"(place) => {PAGE}.onPage({PAGE}.sphere.center.clone().set(...place))", list(place))
    return x, y


def click(page, *place: float) -> None:
    page.mouse.click(*on_page(page, place))
    settled(page)


def begin(page, name: str, kind: str, template: str = "rod") -> None:
    page.fill("#name", name)
    page.select_option("#kind", kind)
    page.select_option("#template", template)
    page.get_by_role("button", name="Place", exact=True).click()


pytestmark = needs_browser


def test_two_clicks_place_a_bone_in_the_middle_of_the_limb(page, session: BoneSession) -> None:
    """Rays are not parallel to z: the middle lies off the axis by what perspective tells, and no more."""
    begin(page, "femur", "cylinder")
    assert "over one end" in page.inner_text("#said")
    click(page, -55.0, 0.0, 0.0)
    click(page, 0.0, 45.0, 0.0)
    assert "That is not on the skin. Click the skin over its other end" in page.inner_text("#said")
    click(page, 20.0, 0.0, 0.0)
    ends = np.array(session.file.bones["femur"].points)
    np.testing.assert_allclose(ends, [[-55, 0, 0], [20, 0, 0]], atol=0.3)
    bone = session.bones["femur"].vertices
    assert bone[:, 0].min() == pytest.approx(ends[0, 0], abs=0.5) and SKIN.contains(bone).all()
    page.get_by_role("button", name="right", exact=True).click()
    settled(page)
    start, end = on_page(page, tuple(ends[1])), on_page(page, (35.0, 0.0, 6.0))
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*((np.array(start) + end) / 2))
    page.mouse.move(*end)
    page.mouse.up()
    settled(page)
    moved = session.file.bones["femur"].points[1]
    assert moved == pytest.approx((35, 0, 6), abs=1.5)
    page.keyboard.press("Control+z")
    settled(page)
    assert session.file.bones["femur"].points[1] == pytest.approx(tuple(ends[1]))
    page.click("#redo")
    settled(page)
    assert session.file.bones["femur"].points[1] == moved


def test_kinds_fields_faults_and_saving(page, session: BoneSession, tmp_path: Path) -> None:
    begin(page, "spine", "curve")
    for x in (-70.0, -45.0, -20.0):
        click(page, x, 2.0, 0.0)
    assert "press Done" in page.inner_text("#said")
    page.click("#done")
    settled(page)
    page.fill("#count", "4")
    page.press("#count", "Tab")
    settled(page)
    assert list(session.bones) == ["spine_1", "spine_2", "spine_3", "spine_4"]
    begin(page, "wedge", "shape", "capitate")
    click(page, 30.0, 0.0, 0.0)
    click(page, 42.0, 0.0, 0.0)
    assert session.file.bones["wedge"].template == "capitate"
    begin(page, "shaft", "cylinder")
    click(page, 52.0, 0.0, 0.0)
    click(page, 85.0, 0.0, 0.0)
    page.fill("#radius", "30")
    page.press("#radius", "Tab")
    settled(page)
    said = page.locator("#faults li").all_inner_texts()
    assert any("bones.shaft: " in t and "outside the skin" in t for t in said)
    page.click("#save")
    page.wait_for_selector("#said.wrong")
    assert "outside the skin" in page.inner_text("#said") and not session.target.exists()
    page.fill("#radius", "5")
    page.press("#radius", "Tab")
    settled(page)
    assert page.locator("#faults li").count() == 0 and page.inner_text("#said") == ""
    page.screenshot(path=tmp_path / "bones.png")
    page.click("#save")
    page.wait_for_selector("#said:has-text('saved 6 bones')")
    assert load_bones(session.target) == session.file
    files = sorted(p.stem for p in (tmp_path / "limb").glob("*.ply"))
    assert files == sorted(session.bones)
    found = read_surface(tmp_path / "limb/shaft.ply", closed=True)
    np.testing.assert_allclose(found.vertices, session.bones["shaft"].vertices, atol=1e-4)
    page.click("#delete")
    settled(page)
    page.click("#save")
    page.wait_for_selector("#said:has-text('saved 5 bones')")
    assert not (tmp_path / "limb/shaft.ply").exists()  # no bone that is placed no longer


def test_a_click_that_fails_changes_nothing(session: BoneSession) -> None:
    before = session.file
    for ray in (
        {"origin": [0, 0, 90], "direction": [0, 1, 0]},
        {"origin": [0, 0], "direction": [0, 1, 0]},
        {"origin": "here"},
        7,
    ):
        content = {"bones": {"a": {"kind": "shape", "points": [[0, 0, 0], {"ray": ray}]}}}
        with pytest.raises(InputError, match="limb.yaml: (click|ray)"):
            session.edit(json.dumps(content).encode())
    assert session.file is before


def test_the_next_command_is_one_that_a_shell_takes(tmp_path: Path) -> None:
    folder = tmp_path / "mein Bein"
    words = shlex.split(curves_command(folder / "leg.yaml", folder / "skin.ply", folder / "bones"))
    assert words[2:] == [
        str(folder / "leg.yaml"),
        "--skin",
        str(folder / "skin.ply"),
        "--bones",
        str(folder / "bones"),
    ]


def test_the_command_names_what_is_wrong(skin: Path, tmp_path: Path, capsys) -> None:
    target = tmp_path / "Länge mit Leerzeichen.yaml"
    target.write_text("bones: {a: {kind: cylinder, points: [[0, 0, 0], [200, 0, 0]]}}", encoding="utf-8")
    assert main(["bones", str(target), "--skin", str(skin), "--check"]) == 1
    said = capsys.readouterr()
    assert "bones.a: " in said.err and "1 fault\n" in said.out
    for further, message in (
        (["--library", str(tmp_path / "none")], "has no surface"),
        (["--skin", str(tmp_path / "no.ply")], "no.ply"),
    ):
        assert main(["bones", str(target), "--skin", str(skin), "--check", *further]) == 1
        assert message in capsys.readouterr().err
    assert main(["bones", str(tmp_path / "bones.txt"), "--skin", str(skin), "--check"]) == 1
    assert "is no YAML file" in capsys.readouterr().err
