"""The page that moves a learned hand, in a real browser: vertices, sliders, fingertips, layers."""

import base64
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize
from tests.browser import chromium, needs_browser, patient

from handpipe.core.configuration import load_dataset
from handpipe.evaluation.player import write_player
from handpipe.evaluation.player.drawn_hand import drawn_hand
from handpipe.levels.fast_skeleton import FastSkeleton
from handpipe.levels.learned_hand import LearnedHand
from handpipe.levels.learning import learn
from handpipe.stages.levels import export_player

from .test_kernels import five_fingers
from .three_bones import LIMITS, random_frames, rig

pytestmark = needs_browser
POSES = np.radians([[0.0, 0.0], [12.0, 31.0], [48.0, -15.0], [25.0, 45.0], [-18.0, 3.0]])
FAR = np.radians([78.0, 70.0])  # frames were learned up to 50 degrees
LEAST = 5e-5  # mm, of single precision
PLAYER = "document.querySelector('main').player"
EVALUATE = (
    "([angles, level]) => { const { hand } = document.querySelector('main').player;"
    "const bytes = new Uint8Array(hand.pose(Float64Array.from(angles), level).buffer);"
    "return [btoa(Array.from(bytes, (b) => String.fromCharCode(b)).join('')), hand.distance(angles)]; }"
)


@pytest.fixture(scope="module")
def hand() -> LearnedHand:
    """A hand of which L0 blends dual quaternions in half of the vertices."""
    made = learn(random_frames(30, upper=50.0), rig())
    return replace(made, dual=np.arange(len(made.dual)) % 2 == 0)


@pytest.fixture(scope="module")
def file(hand: LearnedHand, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("player")
    rig().save(folder / "rig.h5")
    hand.save(folder / "levels.h5")
    dataset = load_dataset(Path(__file__).parents[2] / "config/datasets/phantom-hand-preview.yaml")
    inputs = export_player.Inputs(folder / "rig.h5", folder / "levels.h5")
    export_player.export_player(inputs, folder / "player.html", dataset)
    return folder / "player.html"


@pytest.fixture(scope="module")
def browser() -> Iterator:
    yield from chromium()


@pytest.fixture
def page(browser, file: Path) -> Iterator:
    """The page; no request may leave it."""
    wrong: list[str] = []
    context = patient(browser.new_context(viewport={"width": 1000, "height": 700}, offline=True))
    opened = context.new_page()
    local = ("file:", "data:", "blob:")
    opened.on("request", lambda r: None if r.url.startswith(local) else wrong.append(r.url))
    opened.on("pageerror", lambda error: wrong.append(str(error)))
    opened.goto(file.as_uri())
    opened.wait_for_function(f"{PLAYER} !== undefined")
    yield opened
    context.close()
    assert wrong == []


def settled(page) -> None:
    page.evaluate("() => new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))")


def evaluated(page, angles: np.ndarray, level: str) -> tuple[np.ndarray, float]:
    """Vertices (n, 3) and the alarm's distance as the page computes them."""
    text, distance = page.evaluate(EVALUATE, [angles.tolist(), level])
    return np.frombuffer(base64.b64decode(text), np.float32).reshape(-1, 3), distance


def angles_of(page) -> np.ndarray:
    return np.array(page.evaluate(f"() => [...{PLAYER}.angles]"))


@pytest.mark.parametrize("level", ["L0", "L1"])
def test_vertices_are_those_of_python_up_to_the_stated_rounding(page, hand: LearnedHand, level: str) -> None:
    drawn = drawn_hand(hand)
    stated = page.evaluate(f"() => {PLAYER}.data.rounding")
    assert 0 < stated < 0.02
    assert f"{stated:.3f} mm" in page.locator(".rounding").text_content()
    for angles in POSES:
        vertices, _ = evaluated(page, angles, level)
        far = np.linalg.norm(vertices - drawn.vertices(angles, level), axis=1).max()
        assert far < LEAST + (2 * stated if level == "L1" else 0)
    moved = drawn.vertices(POSES[3], "L0") - drawn.vertices(POSES[3], "L1")
    assert np.linalg.norm(moved, axis=1).max() > 0.2  # the levels differ by more


def test_the_alarms_distance_is_that_of_python_and_its_words_follow(page, hand: LearnedHand) -> None:
    for angles in (*POSES, FAR):
        assert evaluated(page, angles, "L1")[1] == pytest.approx(hand.distance(angles), abs=1e-9)
    said = page.locator(".alarm")
    for angles in (POSES[1], FAR):
        page.evaluate(f"(angles) => {PLAYER}.set(angles)", angles.tolist())
        settled(page)
        unlike = hand.distance(angles) > 1
        assert ("is unlike the learned ones" in said.text_content()) == unlike
        assert ("do not apply" in said.text_content()) == unlike
    assert hand.distance(FAR) > 1 >= hand.distance(POSES[1])


def test_joints_of_two_axes_with_residual_motions(page) -> None:
    made = five_fingers.rig()
    fast = FastSkeleton.of(made)
    arrays = {
        f"skeleton_{name}": np.asarray(value).ravel().tolist()
        for name, value in fast.joints._asdict().items()
    }
    angles = np.random.default_rng(5).uniform(-0.4, 1.2, len(made.angle_names))
    others = {"rest": [], "lower": [], "steps": [], "parts": [], "drivers_ends": [0]}
    found = page.evaluate(
        "async ([arrays, angles]) => { const { LearnedHand } = await import('learned-hand');"
        "return [...new LearnedHand(arrays).motions(Float64Array.from(angles))]; }",
        [arrays | others, angles.tolist()],
    )
    assert np.reshape(found, (-1, 3, 4)) == pytest.approx(fast.motions(angles), abs=1e-9)
    assert {2} <= {int(dofs) for dofs in fast.joints.dofs}


def test_sliders_turn_joints_within_their_limits(page) -> None:
    slider = page.locator("input[name=second_bend]")
    limits = [float(slider.get_attribute(name)) for name in ("min", "max")]
    assert limits == pytest.approx(np.degrees(LIMITS[0]))
    slider.fill("40")
    settled(page)
    assert angles_of(page) == pytest.approx(np.radians([0, 40]))
    assert page.locator("label", has=slider).locator("output").text_content() == "40°"
    page.get_by_role("button", name="rest").click()
    settled(page)
    assert angles_of(page) == pytest.approx([0, 0])
    assert page.locator("label", has=slider).locator("output").text_content() == "0°"


@pytest.mark.parametrize(("across", "down"), [(50, 130), (-60, 160), (300, 400)])
def test_a_dragged_fingertip_follows_the_pointer_as_far_as_limits_allow(page, across, down) -> None:
    """Against a minimiser of another library over the same two angles."""
    page.get_by_role("button", name="thumb").click()  # sees the plane in which the fingers bend
    settled(page)
    tip = f"{PLAYER}.tips[0]"
    height = f"() => {PLAYER}.canvas.getBoundingClientRect().height"
    begin, before = np.array(page.evaluate(f"() => {PLAYER}.onPage({tip})")), page.evaluate(height)
    page.mouse.move(*begin)
    page.mouse.down()
    page.mouse.move(*(begin + [across, down]), steps=6)
    page.wait_for_function(f"{PLAYER}.drag.frames < 2 || {PLAYER}.drag.left < 0.2")
    settled(page)
    reached = np.array(page.evaluate(f"() => {PLAYER}.onPage({tip})"))
    assert page.evaluate(height) == before  # longer texts below do not move the hand under the pointer
    page.mouse.up()
    angles = angles_of(page)
    assert (angles >= LIMITS[0, 0]).all() and (angles <= LIMITS[0, 1]).all() and np.abs(angles).max() > 0.2

    def apart(values: np.ndarray) -> float:
        there = page.evaluate(
            f"(angles) => {{ {PLAYER}.set(angles); {PLAYER}.compute(); return {PLAYER}.onPage({tip}); }}",
            list(values),
        )
        return float(np.linalg.norm(np.array(there) - begin - [across, down]))

    found = [minimize(apart, start, method="Nelder-Mead", bounds=[*LIMITS, *LIMITS]) for start in POSES[:3]]
    best = min(result.fun for result in found)
    assert np.linalg.norm(reached - begin - [across, down]) < best + 3  # pixels


def test_layers_and_levels_are_switched_and_errors_are_those_that_the_hand_states(
    page, hand: LearnedHand
) -> None:
    shown = f"() => {PLAYER}.bodies.filter((b) => b.meshes[0].visible).map((b) => b.layer)"
    assert {"skin", "muscles", "bones"} <= set(page.evaluate(shown))
    page.get_by_label("muscles").uncheck()
    assert set(page.evaluate(shown)) == {"skin", "bones"}
    bodies = {"skin": hand.bodies["fat", "skin"], "muscles": hand.bodies["muscles", "muscle"]}
    for name, body in bodies.items():
        row = page.locator(".errors tr", has_text=name).locator("td").all_text_contents()[1:]
        said = [tuple(map(float, cell.split(";"))) for cell in row]
        stated = [body.errors["L1"], body.errors["L0"]]
        assert said == [pytest.approx((e.mean, e.largest), abs=0.051) for e in stated]
        assert said[0] != said[1]
    page.locator("select.level").select_option("L0")
    page.locator("input[name=first_bend]").fill("30")
    settled(page)
    found = page.evaluate(f"() => [...{PLAYER}.hand.vertices]")
    expected = drawn_hand(hand).vertices(np.radians([30.0, 0.0]), "L0")
    skin = slice(len(bodies["muscles"].rest), len(bodies["muscles"].rest) + len(bodies["skin"].rest))
    assert np.reshape(found, (-1, 3))[skin] == pytest.approx(expected[skin], abs=1e-4)


def test_a_hand_of_bones_alone_has_a_page(hand, browser, tmp_path: Path) -> None:
    only = hand.only(lambda body: body[0] == "bones")
    write_player(tmp_path / "bones.html", "bones", only, rig(), "right")
    page = patient(browser.new_context()).new_page()
    page.goto((tmp_path / "bones.html").as_uri())
    page.wait_for_function(f"{PLAYER} !== undefined")
    assert page.locator("input.opacity").is_disabled()
    data = json.loads(page.locator("#data").text_content())
    assert [body["layer"] for body in data["bodies"]] == ["bones"] * 3
    page.close()
