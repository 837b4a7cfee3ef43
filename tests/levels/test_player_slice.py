"""The neutral image in the moving hand, in a real browser: exact in neutral and in bones, within the skin."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.browser import chromium, needs_browser, patient

from handpipe.evaluation.player import packed_image as packing
from handpipe.evaluation.player import write_player
from handpipe.imaging.volumes import Volume
from handpipe.levels.learned_hand import LearnedHand
from handpipe.levels.learning import learn

from .three_bones import motions, random_frames, rig

pytestmark = needs_browser
PLAYER = "document.querySelector('main').player"
GREY = 3.0  # of 255 levels: rounding to integers, and straight lines between voxels of half a millimetre
PIXELS = (
    f"() => {{ const {{ slice }} = {PLAYER}, found = [], n = slice.size;"
    "for (let j = 0; j < n; j++) for (let i = 0; i < n; i++)"
    "found.push([...slice.point(i, j), slice.pixels[4 * (j * n + i)], slice.pixels[4 * (j * n + i) + 3]]);"
    "return found; }"
)
BENT = np.radians([40.0, -10.0])


def shade(points: np.ndarray) -> np.ndarray:
    x, y, z = np.moveaxis(points, -1, 0)
    return 300 + 100 * np.sin(x / 6) + 70 * np.cos(y / 5) + 60 * np.sin(z / 4 + 1)


def image(spacing: float = 0.5) -> Volume:
    """A smooth image around the hand, on a grid that is turned by a quarter."""
    affine = np.array([[0, -spacing, 0, 56.0], [spacing, 0, 0, -14.0], [0, 0, spacing, -14.0], [0, 0, 0, 1]])
    shape = (int(28 / spacing), int(72 / spacing), int(28 / spacing))
    volume = Volume(np.zeros(shape, np.float32), affine)
    return volume.like(shade(volume.to_world(np.indices(shape).reshape(3, -1).T)).reshape(shape))


@pytest.fixture(scope="module")
def hand() -> LearnedHand:
    return learn(random_frames(20, upper=50.0), rig())


@pytest.fixture(scope="module")
def browser() -> Iterator:
    yield from chromium()


@pytest.fixture(scope="module")
def page(browser, hand: LearnedHand, tmp_path_factory: pytest.TempPathFactory) -> Iterator:
    """A page that shows the plane in which the bones bend."""
    path, wrong = tmp_path_factory.mktemp("slice") / "player.html", []
    write_player(path, "sliced", hand, rig(), "right", image=image())
    opened = patient(browser.new_context(offline=True)).new_page()
    opened.on("pageerror", lambda error: wrong.append(str(error)))
    opened.goto(path.as_uri())
    opened.wait_for_function(f"{PLAYER} !== undefined")
    opened.locator("select.cut").select_option("thumb")
    yield opened
    opened.context.close()
    assert wrong == []


def shown(page, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (n, 3) of all pixels, their grey, and whether they lie in the skin, at angles in rad."""
    page.evaluate(f"(angles) => {{ {PLAYER}.set(angles); {PLAYER}.compute(); }}", angles.tolist())
    found = np.array(page.evaluate(PIXELS))
    return found[:, :3], found[:, 3], found[:, 4] == 255


def test_in_neutral_it_is_the_image_within_the_skin(page) -> None:
    points, grey, inside = shown(page, np.zeros(2))
    along, off = points[:, 0], np.hypot(points[:, 1], points[:, 2])
    assert inside[(off < 7.5) & (along > -4) & (along < 44)].all()
    assert not inside[(off > 8.2) | (along < -5.2) | (along > 45.2)].any()
    truth = shade(points[inside])
    scale, shift = np.polyfit(truth, grey[inside], 1)
    assert scale > 0.3
    plain = grey[inside] < 254  # the brightest half percent is white
    assert np.abs(scale * truth + shift - grey[inside])[plain].max() < GREY


def test_a_bone_takes_its_image_with_it(page) -> None:
    points, grey, inside = shown(page, np.zeros(2))
    scale, shift = np.polyfit(shade(points[inside]), grey[inside], 1)
    points, grey, inside = shown(page, BENT)
    for number, motion in enumerate(motions(BENT)):
        neutral = motion.inverse()(points)
        bone = np.linalg.norm(neutral - [20.0 * number, 0, 0], axis=1) < 3.2
        assert bone.sum() > 20 and inside[bone].all()
        expected = np.minimum(scale * shade(neutral[bone]) + shift, 255)
        assert np.abs(expected - grey[bone]).max() < GREY
    moved = np.abs(scale * shade(points[inside]) + shift - grey[inside])
    assert moved.max() > 20  # an image that stays in its place would be found out


def test_soft_tissue_follows_the_skin(page, hand: LearnedHand) -> None:
    """Near a vertex of the skin the image is that near its neutral place."""
    points, grey, inside = shown(page, np.zeros(2))
    scale, shift = np.polyfit(shade(points[inside]), grey[inside], 1)
    points, grey, inside = shown(page, BENT)
    skin, moved = hand.bodies["fat", "skin"].rest, hand.split(hand.vertices(BENT, "L1"))["fat", "skin"]
    distances = np.linalg.norm(points[inside][:, None] - moved, axis=2)
    near, pixel = distances.min(axis=1) < 1.2, distances.argmin(axis=1)
    assert near.sum() > 20
    expected, still = scale * shade(skin[pixel[near]]) + shift, scale * shade(points[inside][near]) + shift
    off, unmoved = np.abs(expected - grey[inside][near]), np.abs(still - grey[inside][near])
    assert np.median(off) < 5 < 15 < np.median(unmoved)
    assert off.max() < 20  # a millimetre is up to 13 levels


def test_it_is_moved_hides_what_is_before_it_and_is_switched_off(page) -> None:
    page.locator("input.depth").fill("3")
    points, _, inside = shown(page, np.zeros(2))
    side = page.evaluate(f"() => {PLAYER}.data.views.thumb.slice(0, 3)")
    centre = page.evaluate(f"() => {PLAYER}.slice.sphere.center.toArray()")
    assert (points - centre) @ side == pytest.approx(np.full(len(points), 3.0), abs=1e-6)
    said = page.locator("label", has=page.locator("input.depth")).locator("output")
    assert inside.any() and said.text_content() == "3 mm"
    planes = f"() => {PLAYER}.bodies.map((b) => b.meshes[0].material.clippingPlanes?.length ?? 0)"
    assert set(page.evaluate(planes)) == {1}
    beyond = np.add(centre, np.multiply(side, 4.0)).tolist()
    distance = (
        f"([x, y, z]) => {{ const {{ normal, constant }} = {PLAYER}.slice.plane;"
        "return normal.dot({ x, y, z }) + constant; }"
    )
    assert page.evaluate(distance, beyond) == pytest.approx(-1.0)
    page.locator("select.cut").select_option("")
    assert set(page.evaluate(planes)) == {0}
    assert not page.evaluate(f"() => {PLAYER}.slice.mesh.visible")
    assert page.locator("input.depth").is_disabled()
    page.locator("input.depth").evaluate("(depth) => { depth.value = 0; }")
    page.locator("select.cut").select_option("thumb")


def test_the_packed_image_is_small_and_black_beyond_the_image(monkeypatch) -> None:
    points = np.array([[-20.0, -9, -9], [45.0, 9, 9]])
    monkeypatch.setattr(packing, "VOXELS", 20_000)
    grid, values = packing.packed_image(image(), points)
    assert 15_000 < len(values) <= 20_000 and values.dtype == np.uint8
    assert len(values) == np.prod(grid["shape"]) and grid["spacing"] > 1
    places = np.indices(grid["shape"]).reshape(3, -1).T * grid["spacing"] + grid["origin"]
    beyond = places[:, 0] < -17
    assert beyond.any() and not values[beyond].any()
    inner = (np.abs(places[:, 1:]) < 9).all(axis=1) & (places[:, 0] > -10) & (values < 254)
    fit = np.polyfit(shade(places[inner]), values[inner], 1)
    assert np.abs(np.polyval(fit, shade(places[inner])) - values[inner]).max() < 8  # of blur


def test_a_hand_without_image_or_skin_has_no_slice(browser, hand: LearnedHand, tmp_path: Path) -> None:
    bare = hand.only(lambda body: body[0] != "fat")
    for number, (shown_hand, given) in enumerate(((hand, None), (bare, image()))):
        path = tmp_path / f"{number}.html"
        write_player(path, "plain", shown_hand, rig(), "right", image=given)
        page = patient(browser.new_context()).new_page()
        page.goto(path.as_uri())
        page.wait_for_function(f"{PLAYER} !== undefined")
        assert page.locator("select.cut").count() == 0
        page.close()
