"""The report's 3D view in a real browser: play, scrub, names, and views whose directions are known."""

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy.spatial.transform import Rotation
from tests.browser import chromium, needs_browser, patient

from handpipe.core.configuration.anatomy import Bone, Joint
from handpipe.core.configuration.dataset import Dataset
from handpipe.core.configuration.pose import Pose
from handpipe.core.layers import Frame, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.evaluation.report import ReportInput, write_report
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.joint_tree import RigJoint
from handpipe.skeleton.joints.joints import JointFit
from handpipe.skeleton.joints.residual import Residual
from handpipe.skeleton.rig.rig import Rig

pytestmark = needs_browser

PALM = "metacarpal3"
FINGER = "proximal3"
TURN = Rotation.from_rotvec([1.1, -0.8, 1.9]).as_matrix()  # of a hand that lies askew in the scanner
BENT = Rotation.from_rotvec([0, np.pi / 2, 0]).as_matrix()  # of the wrist, to the palm
# Balls by the view that sees them, off a right hand with +x distal, +y radial, +z dorsal.
BALLS = {
    "palm": (0, 0, -40),
    "back": (0, 0, 40),
    "thumb": (0, 40, 0),
    "little finger": (0, -40, 0),
    "fingertips": (40, 0, 0),
}
ABOVE = 0.315  # share of the canvas's height at which a ball above the middle is


def shape(mesh: trimesh.Trimesh, place: np.ndarray, posed: np.ndarray) -> Shape:
    rest = np.asarray(mesh.vertices)
    return Shape(rest @ place.T, rest @ (posed @ place).T, np.asarray(mesh.faces))


def ball(place: tuple[float, float, float], radius: float) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=2, radius=radius).apply_translation(place)


def rig(place: np.ndarray) -> Rig:
    """One finger along x, that flexes to -z, placed in the scanner: of a right and of a left hand."""
    still = Residual(np.zeros((2, 3)), np.zeros(1), np.zeros(1))
    axis = place @ [0.0, 1, 0]
    fit = JointFit(Axes(axis[None], (0,)), place @ [20.0, 0, 0], still, still, np.zeros((0, 1)))
    joint = RigJoint("MP3", PALM, FINGER, ("MP3_flexion",), np.radians([[-20.0, 90.0]]), fit)

    def surface(mesh: trimesh.Trimesh) -> Surface:
        return Surface(np.asarray(mesh.vertices) @ place.T, np.asarray(mesh.faces))

    return Rig(PALM, (joint,), {PALM: surface(ball((0, 0, 0), 5)), FINGER: surface(ball((30, 0, 0), 4))}, {})


def simulated(name: str, hand: str, place: np.ndarray, wrist: np.ndarray):
    """A small hand amid five balls, and a skin about all of them."""
    posed = place @ wrist @ place.T
    side = np.array([1, 1 if hand == "right" else -1, 1])
    layers = {
        "bones": {PALM: shape(ball((0, 0, 0), 5), place, posed)},
        "muscles": {
            f"at {view}": shape(ball(tuple(side * at), 6), place, posed) for view, at in BALLS.items()
        },
        # The ball on the proximal side makes the whole symmetric: its middle is the hand's.
        "tendons": {"at wrist": shape(ball((-40, 0, 0), 6), place, posed)},
        "muscle_fascia": {"sheet": shape(ball((0, 0, 0), 50), place, posed)},
        "skin": {"skin": shape(ball((0, 0, 0), 60), place, posed)},
    }
    return Frame(name, {}, {PALM: RigidTransform(posed, np.zeros(3))}), layers


def dataset(hand: str) -> Dataset:
    return Dataset(
        name="tiny",
        root=Path("nowhere"),
        hand=hand,
        poses={"flat": Pose(role="neutral", volume="v", seeds="s")},
        bones={PALM: Bone(label=1), FINGER: Bone(label=2)},
        joints={
            "MP3": Joint(
                parent=PALM,
                child=FINGER,
                angles=("MP3_flexion",),
                limits_deg=((-20, 90),),
                axis_hints=((0, 1, 0),),
            )
        },
    )


@pytest.fixture(scope="module")
def browser() -> Iterator:
    yield from chromium()


@pytest.fixture
def opened(browser, tmp_path: Path) -> Iterator:
    """Opens the report of two frames, the second with a bent wrist; no request may leave the page."""
    contexts, wrong = [], []

    def open_report(hand: str = "right", place: np.ndarray | None = None):
        place = np.eye(3) if place is None else place
        frames = [simulated("straight", hand, place, np.eye(3)), simulated("bent", hand, place, BENT)]
        scenes = {"wrist": frames, "long": [simulated(f"f{i}", hand, place, np.eye(3)) for i in range(3)]}
        write_report(tmp_path / "report.html", ReportInput(dataset(hand), rig(place), scenes=scenes))
        context = patient(browser.new_context(viewport={"width": 1000, "height": 900}, offline=True))
        contexts.append(context)
        page = context.new_page()
        page.on("request", lambda r: None if r.url.startswith(("file:", "data:")) else wrong.append(r.url))
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.goto((tmp_path / "report.html").as_uri())
        page.wait_for_function("document.querySelector('figure.view').viewer !== undefined")
        page.locator("canvas").scroll_into_view_if_needed()
        return page

    yield open_report
    for context in contexts:
        context.close()
    assert wrong == []


def settled(page) -> None:
    """Waits until what was asked for is drawn."""
    page.evaluate("() => new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))")


def named_at(page, x: float, y: float) -> str | None:
    """What the page says of the body at a share of the canvas's width and height."""
    box = page.locator("canvas").bounding_box()
    page.mouse.move(box["x"] + x * box["width"] + 1, box["y"] + y * box["height"] + 1)
    page.mouse.move(box["x"] + x * box["width"], box["y"] + y * box["height"])
    settled(page)
    label = page.locator("output.picked")
    return label.text_content() if label.is_visible() else None


def press(page, view: str) -> None:
    page.get_by_role("button", name=view, exact=True).click()
    settled(page)


def colours(page) -> np.ndarray:
    """Colours (h, w, 3) of the canvas within its frame, as a person sees them."""
    settled(page)
    picture = Image.open(io.BytesIO(page.locator("canvas").screenshot())).convert("RGB")
    return np.asarray(picture, float)[4:-4, 4:-4]


@pytest.mark.parametrize("hand", ["right", "left"])
@pytest.mark.parametrize("place", [np.eye(3), TURN], ids=["along the axes", "askew"])
def test_each_view_sees_its_side_in_every_frame(opened, hand: str, place: np.ndarray) -> None:
    """The ball in front hides all others at the middle, and the one distal is above it, or the dorsal one."""
    page = opened(hand, place)
    for frame in (0, 1):
        page.locator("input.frame").fill(str(frame))
        for view in BALLS:
            press(page, view)
            assert named_at(page, 0.5, 0.5) == f"at {view} (muscles)"
            sight = page.evaluate(
                "() => { const { camera, controls } = document.querySelector('figure.view').viewer;"
                " return camera.position.clone().sub(controls.target).normalize().toArray(); }"
            )
            wrist = BENT if frame else np.eye(3)
            side = np.array(BALLS[view]) / 40 * [1, 1 if hand == "right" else -1, 1]
            np.testing.assert_allclose(sight, place @ wrist @ side, atol=1e-3)
            upper = "back" if view == "fingertips" else "fingertips"
            assert named_at(page, 0.5, ABOVE) == f"at {upper} (muscles)"


def test_frames_are_scrubbed_and_played(opened) -> None:
    page = opened()
    name = page.locator("output.name")
    assert name.text_content() == "straight"
    before = colours(page)
    page.locator("input.frame").fill("1")
    assert name.text_content() == "bent"
    assert np.abs(colours(page) - before).max() > 50
    page.locator("input.frame").fill("0")
    np.testing.assert_array_equal(colours(page), before)
    page.locator("select.rate").select_option("24")
    page.locator("button.play").click()
    seen = set()
    for _ in range(40):
        seen.add(name.text_content())
        page.wait_for_timeout(30)
    assert seen == {"straight", "bent"}
    page.get_by_role("button", name="Pause").click()
    still = name.text_content()
    page.wait_for_timeout(200)
    assert name.text_content() == still and page.locator("button.play").text_content() == "Play"


def test_layers_and_the_skin_before_what_lies_in_it(opened) -> None:
    page = opened()
    press(page, "palm")
    assert named_at(page, 0.5, 0.5) == "at palm (muscles)"
    assert named_at(page, 0.40, 0.35) == "skin"
    assert named_at(page, 0.02, 0.02) is None
    page.get_by_label("muscles", exact=True).uncheck()
    assert named_at(page, 0.5, 0.5) == f"{PALM} (bones)"
    page.get_by_label("skin").uncheck()
    assert named_at(page, 0.40, 0.35) is None
    page.get_by_label("muscle fascia").check()
    assert named_at(page, 0.40, 0.35) == "sheet (muscle fascia)"
    page.get_by_label("muscle fascia").uncheck()
    shown = colours(page)
    page.get_by_label("bones").uncheck()
    page.get_by_label("tendons").uncheck()
    empty = colours(page)
    assert (empty == 255).all() and (shown < 200).any()


def test_dragging_and_keys_turn_the_hand_and_scenes_change(opened) -> None:
    page = opened()
    press(page, "palm")
    box = page.locator("canvas").bounding_box()
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(middle[0] + box["height"] / 2, middle[1], steps=4)  # half the height is half a turn
    page.mouse.up()
    assert named_at(page, 0.5, 0.5) == "at back (muscles)"
    press(page, "palm")
    page.locator("canvas").focus()
    for _ in range(16):  # 0.1 rad each: a quarter turn
        page.keyboard.press("ArrowRight")
    assert named_at(page, 0.5, 0.5) in ("at thumb (muscles)", "at little finger (muscles)")
    page.locator("select.scene").select_option("long")
    assert page.locator("output.name").text_content() == "f0"
    page.locator("input.frame").fill("2")
    assert page.locator("output.name").text_content() == "f2"
