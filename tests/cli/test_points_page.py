"""The page on which points are marked, in a real browser: clicks at known pixels give the file."""

import json
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.browser import chromium, needs_browser, patient

from handpipe.anatomy.person import Photograph, read_photograph
from handpipe.cli.person import Asked, Made, PointsServer, points_page

from . import photographed

pytestmark = needs_browser


@pytest.fixture(scope="module")
def browser() -> Iterator:
    yield from chromium()


@pytest.fixture(scope="module")
def picture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("picture") / "hand.png"
    photographed.write_picture(path)
    return path


@pytest.fixture
def server(picture: Path, tmp_path: Path) -> Iterator[PointsServer]:
    with PointsServer(picture, Asked(tmp_path / "points.json", tmp_path / "hand")) as found:
        thread = threading.Thread(target=found.serve_forever, daemon=True)
        thread.start()
        yield found
        found.shutdown()
        thread.join()


def test_what_is_no_json_is_answered_and_writes_nothing(server: PointsServer) -> None:
    request = urllib.request.Request(f"{server.address}save", data=b"{", method="POST")
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(request, timeout=60)
    assert refused.value.code == 500
    assert json.loads(refused.value.read())["said"]
    assert not server.asked.points.exists()


@pytest.fixture
def page(browser, server: PointsServer) -> Iterator:
    wrong: list[str] = []
    context = patient(browser.new_context(viewport={"width": 1000, "height": 760}))
    opened = context.new_page()
    opened.on("pageerror", lambda error: wrong.append(str(error)))
    opened.on("request", lambda r: None if r.url.startswith(server.address) else wrong.append(r.url))
    opened.on("dialog", lambda dialog: dialog.accept())
    opened.goto(server.address)
    opened.wait_for_selector("body[data-ready]")
    yield opened
    context.close()
    assert [w for w in wrong if not w.startswith("data:")] == []


def on_page(page, place) -> tuple[float, float]:
    """Where a pixel of the picture is on the page, by the size of the picture's frame alone."""
    box = page.locator("#picture").bounding_box()
    zoom = min(box["width"] / photographed.SIZE[0], box["height"] / photographed.SIZE[1])
    left, top = ((box[k] - zoom * s) / 2 for k, s in zip(("width", "height"), photographed.SIZE, strict=True))
    return box["x"] + left + zoom * place[0], box["y"] + top + zoom * place[1]


def click_all(page, shot: Photograph) -> None:
    """The two ends of the ruler, then each point that is asked for."""
    for place in shot.ruler:
        page.mouse.click(*on_page(page, place))
    page.fill("#distance", str(shot.distance))
    words = {item.get_attribute("value"): item.inner_text() for item in page.locator("#points button").all()}
    names = {f"Mark the {said}": name for name, said in words.items()}
    for _ in shot.points:
        asked = names[page.locator("#asked").inner_text()]
        page.mouse.click(*on_page(page, shot.points[asked]))


def test_clicks_at_known_pixels_are_the_file(page, server: PointsServer) -> None:
    shot = photographed.photograph()
    click_all(page, shot)
    assert page.locator("#asked").inner_text() == f"All is marked: {len(shot.points)} points"
    page.click("#save")
    page.wait_for_function("() => document.querySelector('#said').textContent.startsWith('saved')")
    found = read_photograph(server.asked.points)
    assert found.picture == "hand.png" and (found.hand, found.view) == ("right", "back")
    assert set(found.points) == set(shot.points)
    for name, place in shot.points.items():
        assert found.points[name] == pytest.approx(place, abs=1.5), name
    assert found.scale == pytest.approx(1 / photographed.PIXELS, rel=0.005)


def test_a_mark_is_dragged_undone_and_made_nearer(page, server: PointsServer) -> None:
    ruler, shot = photographed.RULER, photographed.photograph()
    page.mouse.click(*on_page(page, ruler[0]))
    page.mouse.click(*on_page(page, np.add(ruler[1], [40, -30])))
    page.mouse.move(*on_page(page, np.add(ruler[1], [40, -30])))
    page.mouse.down()
    page.mouse.move(*on_page(page, np.add(ruler[1], [10, -10])))
    page.mouse.move(*on_page(page, ruler[1]))
    page.mouse.up()
    marks = lambda: page.evaluate("() => Object.fromEntries(marks)")  # noqa: E731
    assert marks()["ruler 2"] == pytest.approx(ruler[1], abs=2)
    page.mouse.click(*on_page(page, shot.points["tip1"]))
    assert marks()["tip1"] == pytest.approx(shot.points["tip1"], abs=1.5)
    page.keyboard.press("Control+z")
    assert "tip1" not in marks() and "thumb: tip" in page.locator("#asked").inner_text()
    page.keyboard.press("Control+z")
    assert marks()["ruler 2"] == pytest.approx(np.add(ruler[1], [40, -30]), abs=2)
    page.mouse.move(*on_page(page, shot.points["tip1"]))
    page.mouse.wheel(0, -1500)  # zooms about the pointer
    page.wait_for_function("() => zoom > 2")
    box, at = (
        page.locator("#picture").bounding_box(),
        page.evaluate("(p) => onScreen(p)", shot.points["tip1"]),
    )
    assert [box["x"] + at[0], box["y"] + at[1]] == pytest.approx(on_page(page, shot.points["tip1"]), abs=10)
    page.mouse.click(box["x"] + at[0], box["y"] + at[1])
    assert marks()["tip1"] == pytest.approx(shot.points["tip1"], abs=0.3)


def test_the_page_says_what_is_missing_or_wrong(page, server: PointsServer) -> None:
    shot = photographed.photograph()
    page.click("#make")
    assert "Mark both ends of a known length" in page.locator("#said").inner_text()
    click_all(page, shot)
    page.select_option("#hand", "left")
    page.click("#make")
    page.wait_for_function("() => document.querySelector('#said').classList.contains('wrong')")
    assert "show the back of a right hand, not of a left one" in page.locator("#said").inner_text()
    assert not page.locator("#link").is_visible() and not server.asked.folder.exists()
    for _ in range(4):
        page.click("#undo")
    page.click("#make")
    assert "15 points are marked; the hand needs 16 or more" in page.locator("#said").inner_text()


def test_earlier_marks_are_there_and_the_hand_opens(
    picture: Path, tmp_path: Path, browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = tmp_path / "hand" / "player.html"
    asked: list[Asked] = []

    def make(wanted: Asked) -> Made:
        asked.append(wanted)
        made.parent.mkdir()
        made.write_text("<title>moves</title><script>document.title += '!'</script>", encoding="utf-8")
        return Made((made,), ("seconds from points to the page 1.0",))

    monkeypatch.setattr(points_page, "make", make)
    path = tmp_path / "points.json"
    path.write_text(photographed.photograph().model_dump_json(), encoding="utf-8")
    with PointsServer(picture, Asked(path, made.parent)) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        page = patient(browser.new_context()).new_page()
        page.goto(server.address)
        page.wait_for_selector("body[data-ready]")
        assert page.locator("#asked").inner_text().startswith("All is marked")
        page.click("#make")
        page.wait_for_selector("#link:not([hidden])")
        assert "seconds from points to the page" in page.locator("#said").inner_text()
        with page.context.expect_page() as opened:
            page.click("#link")
        patient(opened.value.context)
        opened.value.wait_for_function("document.title === 'moves!'")
        page.click("#end")
        thread.join(timeout=10)
        assert not thread.is_alive()
    assert [a.points for a in asked] == [path]
    assert json.loads(path.read_text())["points"].keys() == photographed.photograph().points.keys()
