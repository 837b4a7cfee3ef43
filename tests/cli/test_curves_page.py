"""The page of handpipe curves in a real browser: drag, add, delete, undo, draw, save, what is wrong."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from tests.anatomy.arm import THREE_MUSCLES, arm
from tests.browser import chromium, needs_browser, opened, settled

from handpipe.anatomy.templates import load_curves
from handpipe.cli.muscle_curves import CurveServer, CurveSession

pytestmark = needs_browser
SURFACES = arm(4.0)
PAGE = "document.querySelector('main').page"
TETS_PATIENCE = 900_000.0  # ms; on a free computer tets take some seconds
SLOWEST = 3.0  # s from an edit to its view, by a browser that draws without a graphics card


@pytest.fixture(scope="module")
def browser() -> Iterator:
    yield from chromium()


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> CurveSession:
    path = tmp_path_factory.mktemp("curves") / "arm.yaml"
    path.write_text(THREE_MUSCLES, encoding="utf-8")
    return CurveSession(path, *SURFACES, 4.0)


@pytest.fixture
def page(browser, session: CurveSession, tmp_path: Path) -> Iterator:
    """The page of the arm as its file has it; no request may leave this computer."""
    session.target, session.kept = tmp_path / "arm.yaml", None
    session.target.write_text(THREE_MUSCLES, encoding="utf-8")
    session.edit(json.dumps(yaml.safe_load(THREE_MUSCLES)).encode())
    with opened(browser, CurveServer(session)) as shown:
        yield shown


def place_of(page, muscle: str, point: int) -> tuple[float, float]:
    """Pixels of a curve's point on the page."""
    x, y = page.evaluate(
        f"([muscle, point]) => {{ const page = {PAGE}, wanted = [muscle, 'curves', 0, point].join();"
        "const at = page.points.find(({ id }) => [id.muscle, id.kind, id.list, id.point].join() === wanted);"
        "return page.onPage(at.mesh.position); }",
        [muscle, point],
    )
    return x, y


def on_page(page, place: tuple[float, float, float]) -> tuple[float, float]:
    """Pixels of a place in space on the page."""
    x, y = page.evaluate(
        f"(place) => {PAGE}.onPage({PAGE}.points[0].mesh.position.clone().set(...place))", list(place)
    )
    return x, y


def drag(page, start: tuple[float, float], end: tuple[float, float]) -> None:
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*((np.array(start) + end) / 2))
    page.mouse.move(*end)
    page.mouse.up()
    settled(page)


def answer_of_tets(page) -> str:
    """What the page says once the tets are made or refused: a fault is not waited for in vain."""
    page.click("#tets")
    page.wait_for_selector("#tets:not([disabled])", timeout=TETS_PATIENCE)
    return str(page.inner_text("#said"))


def points(session: CurveSession, muscle: str = "flexor") -> list[Any]:
    return list(session.draft.muscles[muscle].curves[0].points)


def look(page, view: str) -> None:
    page.get_by_role("button", name=view, exact=True).click()
    settled(page)


def test_a_dragged_point_moves_and_the_muscle_follows(page, session: CurveSession, tmp_path: Path) -> None:
    look(page, "right")
    before = session.edited.surfaces["flexor"].vertices[:, 2].min()
    x, y = place_of(page, "flexor", 1)
    drag(page, (x, y), on_page(page, (6.0, 0.0, -9.0)))
    moved = points(session)[1]
    np.testing.assert_allclose(moved.at, [6, 0, -9], atol=0.5)  # half a pixel
    assert moved.tissue == 1.5
    assert session.edited.surfaces["flexor"].vertices[:, 2].min() > before + 0.5
    latencies = page.evaluate(f"{PAGE}.latencies")
    assert len(latencies) > 1 and max(latencies) < 1000 * SLOWEST
    assert "until it was drawn" in page.inner_text("#cost")
    page.screenshot(path=tmp_path / "dragged.png")
    page.keyboard.press("Control+z")
    settled(page)
    assert points(session)[1].at == (0, 0, -12)
    page.click("#redo")
    settled(page)
    np.testing.assert_allclose(points(session)[1].at, [6, 0, -9], atol=0.5)


def test_a_point_on_a_bone_slides_on_it(page, session: CurveSession) -> None:
    look(page, "right")
    drag(page, place_of(page, "extensor", 0), on_page(page, (-10.0, 3.0, 2.0)))
    first = points(session, "extensor")[0]
    assert first.bone == "radius" and first.at is None
    np.testing.assert_allclose(first.along, (35 - 10) / 70, atol=0.02)
    assert session.edited.muscles["extensor"].curves[0].points[0][1] > 3  # on the side that is seen


def choose(page, muscle: str, point: int) -> None:
    page.mouse.click(*place_of(page, muscle, point))
    settled(page)


def fill(page, selector: str, value: object) -> None:
    page.fill(selector, str(value))
    page.press(selector, "Tab")
    settled(page)


def test_fields_change_the_chosen_point_and_muscle(page, session: CurveSession) -> None:
    look(page, "right")
    choose(page, "flexor", 1)
    fill(page, "#tissue", 0.75)
    fill(page, "#spread-0", 0.5)
    assert points(session)[1].tissue == 0.75 and points(session)[1].spread == (0.5, 1)
    assert session.draft.muscles["flexor"].curves[0].normal is not None
    fill(page, "#reach", 4)
    fill(page, "#volume", 9000)
    page.select_option("#fibres", "flow")
    fill(page, "#fat", 0.4)  # before the answer to the change of fibres
    flexor = session.draft.muscles["flexor"]
    assert (flexor.reach, flexor.volume, flexor.fibres, session.draft.fat) == (4, 9000, "flow", 0.4)
    page.click("#add-point")
    settled(page)
    assert len(points(session)) == 4
    page.click("#to-bone")
    settled(page)
    assert points(session)[2].bone == "radius"
    page.click("#delete-point")
    settled(page)
    assert len(points(session)) == 3


def test_a_muscle_is_drawn_attached_and_saved(page, session: CurveSession) -> None:
    look(page, "left")
    page.fill("#name", "brachialis")
    page.press("#name", "Enter")
    page.mouse.click(*on_page(page, (-22.0, -5.0, 0.0)))
    assert "where it ends" in page.inner_text("#said")
    page.mouse.click(*on_page(page, (0.0, 0.0, 30.0)))
    assert "That is no bone" in page.inner_text("#said")
    page.mouse.click(*on_page(page, (22.0, -5.0, 0.0)))
    settled(page)
    ends = [p.bone for p in points(session, "brachialis")]
    assert ends == ["radius", None, "radius"]
    page.click("#add-insertion")
    page.mouse.click(*on_page(page, (15.0, -5.0, 0.0)))
    settled(page)
    [attachment] = session.draft.muscles["brachialis"].attachments
    assert attachment.end == "insertion" and attachment.points[0].bone == "radius"
    assert "smallest dihedral angle" in answer_of_tets(page)
    assert session.target.with_suffix(".h5").is_file()
    assert page.evaluate(f"{PAGE}.fibres.length") > 600
    settled(page)
    page.screenshot(path=session.target.with_suffix(".png"))
    page.click("#save")
    page.wait_for_selector("#said:has-text('saved 4 muscles')")
    assert load_curves(session.target) == type(load_curves(session.target)).model_validate(
        session.draft.model_dump(exclude_unset=True)
    )
    page.on("dialog", lambda dialog: dialog.accept())
    page.click("#delete-muscle")
    settled(page)
    assert "brachialis" not in session.draft.muscles


def test_what_is_wrong_is_said_once(page, session: CurveSession) -> None:
    look(page, "right")
    drag(page, place_of(page, "flexor", 1), on_page(page, (0.0, 0.0, -26.0)))
    assert [t for t in page.locator("#faults li").all_inner_texts() if "outside the skin" in t]
    assert "Move its points into the skin" in answer_of_tets(page)
    assert page.locator("#said.wrong").count() == 1
    page.click("#undo")
    settled(page)
    assert page.locator("#faults li").count() == 0
    for point, place in ((0, (-28.0, 0.0, -14.0)), (2, (28.0, 0.0, -14.0))):
        choose(page, "flexor", point)
        page.click("#to-space")
        settled(page)
        drag(page, place_of(page, "flexor", point), on_page(page, place))
        if point == 0:
            [said] = page.locator("#warnings li").all_inner_texts()
            assert said.startswith("flexor: its origin lies")
    [said] = page.locator("#faults li").all_inner_texts()
    assert said.startswith("muscles.flexor: is attached to no bone: its origin lies")
