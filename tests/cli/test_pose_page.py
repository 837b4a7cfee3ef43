"""The simulated pose on the page of handpipe curves in a real browser."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.anatomy.two_bones import TWO_MUSCLES, elbow
from tests.browser import chromium, needs_browser, opened, settled
from tests.cli.test_curves_page import PAGE, answer_of_tets, look

from handpipe.cli.muscle_curves import CurveServer, CurveSession

pytestmark = needs_browser
SOLVE_PATIENCE = 300_000.0  # ms; on a free computer the solve takes some seconds


@pytest.fixture(scope="module")
def browser() -> Iterator:
    yield from chromium()


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> CurveSession:
    path = tmp_path_factory.mktemp("pose") / "arm.yaml"
    path.write_text(TWO_MUSCLES, encoding="utf-8")
    return CurveSession(path, *elbow(6.0), 6.0)


@pytest.fixture
def page(browser, session: CurveSession) -> Iterator:
    with opened(browser, CurveServer(session)) as shown:
        yield shown


def said(page) -> str:
    return str(page.inner_text("#said"))


def ghost_turns(page) -> list[float]:
    """Degrees by which the preview of each moving bone is turned."""
    found = page.evaluate(
        f"{PAGE}.pose.ghost.children.filter(c => c.isMesh).map(c => 2 * Math.acos(Math.abs(c.quaternion.w)))"
    )
    return [float(np.degrees(angle)) for angle in found]


def visible(page) -> tuple[bool, bool, bool]:
    """Whether curves, bones and skin are shown at rest."""
    shown = page.evaluate(f"[{PAGE}.drawn.visible, {PAGE}.bones[0].visible, {PAGE}.skin[0].visible]")
    return tuple(shown)


def test_a_pose_is_previewed_simulated_and_left(page, session: CurveSession, tmp_path: Path) -> None:
    look(page, "right")
    page.click("#pose summary")
    page.wait_for_selector("#pose-joint:has-text('radius turns on humerus')")
    page.fill("#pose-degrees", "35")
    assert ghost_turns(page) == pytest.approx([35.0], abs=1e-3)
    assert page.input_value("#pose-angle") == "35"
    page.click("#simulate")
    page.wait_for_selector("#said.wrong")
    assert "Press Make tets" in said(page)
    assert "smallest dihedral angle" in answer_of_tets(page)
    page.fill("#pose-degrees", "130")
    page.click("#simulate")
    page.wait_for_selector("#said:has-text('no number from -120 to 120')")
    page.fill("#pose-degrees", "35")
    page.click("#simulate")
    page.wait_for_selector("#rest:not([disabled])")
    page.wait_for_selector("#said:has-text('residual')", timeout=SOLVE_PATIENCE)
    page.wait_for_selector("#said:has-text('Simulated')", timeout=SOLVE_PATIENCE)
    settled(page)
    page.screenshot(path=tmp_path / "posed.png")
    assert visible(page) == (False, False, False) and ghost_turns(page) == []
    folder = session.target.with_name("arm-pose-radius-bend-35")
    assert str(folder) in said(page) and (folder / "skin.ply").is_file()
    shown = page.evaluate(f"Array.from({PAGE}.pose.posed.arrays['bone/radius/vertices'])")
    lowest = np.array(shown).reshape(-1, 3)[:, 2].min()
    assert lowest < -15  # it has bent to the back
    page.uncheck("#show-muscles")
    count = page.evaluate(f"{PAGE}.pose.posed.group.children.length")
    page.check("#show-muscles")
    assert page.evaluate(f"{PAGE}.pose.posed.group.children.length") > count
    page.click("#rest")
    page.wait_for_selector("#said:has-text('At rest')")
    assert visible(page) == (True, True, True) and page.is_disabled("#rest")
    assert session.pose_state() == {"state": "rest"}


def test_an_edit_discards_the_pose_and_stop_ends_a_solve(page, session: CurveSession) -> None:
    page.click("#pose summary")
    page.wait_for_selector("#pose-joint:has-text('radius turns on humerus')")
    if session.tissue is None:
        answer_of_tets(page)
    page.fill("#pose-degrees", "5")
    page.click("#simulate")
    page.wait_for_selector("#said:has-text('Simulated')", timeout=SOLVE_PATIENCE)
    page.fill("#fat", "0.32")
    page.press("#fat", "Tab")
    settled(page)
    assert visible(page) == (True, True, True) and session.pose_state() == {"state": "rest"}
    page.click("#undo")
    settled(page)
    page.fill("#pose-degrees", "90")
    page.click("#simulate")
    page.wait_for_selector("#rest:has-text('Stop')")  # as long as the solve runs; what is said soon changes
    page.click("#rest")
    page.wait_for_selector("#said:has-text('At rest')")
    assert session.pose_state() == {"state": "rest"}
