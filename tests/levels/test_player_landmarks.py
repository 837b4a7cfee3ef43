"""A page that a file of landmarks moves, in a real browser: angles found again, limits, wrong files."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.browser import chromium, needs_browser, patient

from handpipe.core.errors import InputError
from handpipe.core.layers import Frame, Shape
from handpipe.evaluation.player import write_player
from handpipe.levels.learning import learn
from handpipe.skeleton.drivers import LANDMARKS
from handpipe.skeleton.drivers.bone_lines import bone_tips
from handpipe.skeleton.drivers.landmark_motion import read_landmark_angles
from handpipe.skeleton.drivers.landmarks import FINGERS, read_landmarks

from . import three_bones
from .test_kernels import five_fingers

pytestmark = needs_browser
RIG = five_fingers.rig()
TIPS, LIMITS = bone_tips(RIG), np.array([RIG.limits[name] for name in RIG.angle_names])
CAMERA = Rotation.from_euler("xyz", [2.0, -0.4, 1.1]).as_matrix()
PLAYER = "document.querySelector('main').player"
ENDED = (
    "() => { const { textContent: said, classList } = document.querySelector('.said');"
    "return said.includes('Root mean squares') || classList.contains('on'); }"
)


def seen(angles: dict[str, float], lengths: float = 1.0) -> np.ndarray:
    """The 21 points (21, 3) in m that a camera sees of a hand 1.3 times as large, by a formula of its own.

    lengths: stretches the fingers beyond their knuckles
    """
    centres = {joint[2]: np.array(joint[5]) for joint in five_fingers.DESCRIPTION}
    parents = {joint[2]: joint[1] for joint in five_fingers.DESCRIPTION}
    knuckles = np.array([*five_fingers.KNUCKLES.values()])
    points = [knuckles.mean(axis=0) - 70.0 * np.array([66.0, 4, 0]) / np.hypot(66, 4)]
    for digit in range(1, 6):
        parts = ("metacarpal", "proximal", "distal") if digit == 1 else ("proximal", "middle", "distal")
        bones = [f"{part}{digit}" for part in parts]
        chain = [five_fingers.posed(centres[b], parents[b], angles)[0] for b in bones]
        chain.append(five_fingers.posed(TIPS[bones[-1]], bones[-1], angles)[0])
        points += [*(chain[0] + np.cumsum([np.zeros(3), *(lengths * np.diff(chain, axis=0))], axis=0))]
    return 0.0013 * np.array(points) @ CAMERA.T + [0.1, 0.2, 0.5]


def table(frames: list[np.ndarray], delimiter: str = ",") -> str:
    rows = [["frame", *(f"{name}_{c} [m]" for name in LANDMARKS for c in "xyz")]]
    rows += [[f"f{i}", *map(repr, points.ravel().tolist())] for i, points in enumerate(frames)]
    text = "\n".join(delimiter.join(row) for row in rows)
    return text if delimiter == "," else text.replace(".", ",")


def values_of(angles: dict[str, float]) -> np.ndarray:
    return np.array([angles[name] for name in RIG.angle_names])


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of five fingers' bones; only the palm has a skin."""
    frames = []
    for seed in range(10):
        angles = five_fingers.random_angles(seed)
        bones = RIG.bone_transforms(angles)
        shapes = {b: Shape(s.vertices, bones[b](s.vertices), s.triangles) for b, s in RIG.surfaces.items()}
        frames.append(
            (Frame(f"random{seed}", angles, bones), {"bones": shapes, "fat": {"skin": shapes["carpals"]}})
        )
    path = tmp_path_factory.mktemp("landmarks") / "player.html"
    write_player(path, "five fingers", learn(frames, RIG), RIG, "right")
    return path


@pytest.fixture(scope="module")
def browser() -> Iterator:
    yield from chromium()


@pytest.fixture
def page(browser, file: Path) -> Iterator:
    wrong: list[str] = []
    context = patient(browser.new_context(viewport={"width": 1000, "height": 700}, offline=True))
    opened = context.new_page()
    opened.on("pageerror", lambda error: wrong.append(str(error)))
    opened.goto(file.as_uri())
    opened.wait_for_function(f"{PLAYER} !== undefined")
    yield opened
    context.close()
    assert wrong == []


def opened(page, name: str, text: str) -> str:
    """What the page says after a file is opened, when its motion is stopped."""
    page.locator(".said").evaluate("(said) => { said.textContent = ''; said.classList.remove('on'); }")
    page.locator("input.file").set_input_files({"name": name, "mimeType": "", "buffer": text.encode()})
    page.wait_for_function(ENDED)
    page.evaluate(f"() => {PLAYER}.stop()")
    return page.locator(".said").text_content()


def residual(said: str) -> float:
    """Distance in mm of the landmarks, as the page states it."""
    return float(re.search(r"landmarks (\S+) mm", said)[1])


def found(page) -> np.ndarray:
    return np.array(page.evaluate(f"() => {PLAYER}.tracked.found.map(({{ angles }}) => [...angles])"))


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_landmarks_of_another_size_and_place_give_back_the_angles(page, delimiter: str) -> None:
    truth = [five_fingers.random_angles(seed, 0.95) for seed in range(6)]
    said = opened(page, "walk.csv", table([seen(angles) for angles in truth], delimiter))
    assert "6 frames" in said and residual(said) < 0.2
    apart = np.degrees(np.abs(found(page) - [values_of(angles) for angles in truth]))
    assert apart.max() < 0.2
    page.locator("input.frame").fill("4")
    now = np.array(page.evaluate(f"() => [...{PLAYER}.angles]"))
    assert np.degrees(now) == pytest.approx(np.degrees(values_of(truth[3])), abs=0.2)
    row = page.locator("label", has=page.locator("input.frame"))
    assert row.locator("span").text_content() == "frame f3"
    assert row.locator("output").text_content() in ("0.0 mm", "0.1 mm")


def test_landmarks_of_the_other_hand_are_mirrored(page) -> None:
    truth = five_fingers.random_angles(7)
    points = (seen(truth) * [-1.0, 1, 1]).tolist()
    named = [dict(zip("xyz", point, strict=True)) for point in points]
    for frame in (points, named):
        data = {"units": "m", "handedness": "Left", "frames": [frame]}
        assert residual(opened(page, "left.json", json.dumps(data))) < 0.2
        assert np.degrees(found(page)[0]) == pytest.approx(np.degrees(values_of(truth)), abs=0.2)
    opened(page, "right.json", json.dumps(data | {"handedness": "Right"}))
    assert (
        np.degrees(np.abs(found(page)[0] - values_of(truth))).max() > 10
    )  # the mirror image is no right hand


def test_limits_are_kept_and_the_residual_tells_what_they_leave(page) -> None:
    beyond = dict.fromkeys(RIG.angle_names, 0.2) | {"PIP3_flexion": np.radians(125.0)}  # limit: 110
    said = opened(page, "bent.csv", table([seen(beyond)]))
    angles = found(page)[0]
    assert (angles >= LIMITS[:, 0]).all() and (angles <= LIMITS[:, 1]).all()
    assert np.degrees(angles[RIG.angle_names.index("PIP3_flexion")]) == pytest.approx(110, abs=1e-6)
    others = [n for n in RIG.angle_names if not n.endswith("3_flexion")]
    apart = angles - values_of(beyond)
    assert np.degrees(np.abs([apart[RIG.angle_names.index(n)] for n in others])).max() < 3
    assert 0.5 < residual(said) < 5


def test_fingers_of_other_lengths_give_nearly_the_same_angles(page) -> None:
    truth = five_fingers.random_angles(4, 0.7)
    said = opened(page, "long.csv", table([seen(truth, lengths=1.15)]))
    assert np.degrees(np.abs(found(page)[0] - values_of(truth))).mean() < 3
    assert residual(said) > 2


@pytest.mark.parametrize("wrist", [0.6, 1.0, 1.5])
def test_a_scene_of_the_same_recording_has_the_same_poses(page, tmp_path: Path, wrist: float) -> None:
    """Trackers place the wrist otherwise, landmarks are off by 2 mm, fingers are of another person."""
    rng, frames = np.random.default_rng(3), []
    for seed in range(4):
        points = seen(five_fingers.random_angles(seed, 0.7), lengths=1.1) + 0.0026 * rng.normal(size=(21, 3))
        knuckles = points[[LANDMARKS.index(f"{f}_MCP") for f in FINGERS]].mean(axis=0)
        points[0] = knuckles + wrist * (points[0] - knuckles)
        frames.append(points)
    (tmp_path / "noisy.csv").write_text(table(frames), encoding="utf-8")
    opened(page, "noisy.csv", table(frames))
    scene = [values_of(angles) for angles in read_landmark_angles(tmp_path / "noisy.csv", RIG).values()]
    apart = np.degrees(np.abs(found(page) - scene))
    assert apart.max() < 0.01


def test_a_dropped_file_is_played_at_24_frames_a_second_until_stopped(page) -> None:
    truth = [five_fingers.random_angles(seed, 0.3) for seed in range(3)]
    page.evaluate(
        "(text) => { const dataTransfer = new DataTransfer(), drop = { bubbles: true, dataTransfer };"
        "dataTransfer.items.add(new File([text], 'drop.csv'));"
        "document.querySelector('canvas').dispatchEvent(new DragEvent('drop', drop)); }",
        table([seen(angles) for angles in truth]),
    )
    page.wait_for_function(ENDED)
    button = page.locator("button.tracked")
    assert button.text_content() == "Stop"
    shown = (
        f"(t) => {{ const play = {PLAYER}.playing; return [...{PLAYER}.along(play.began + 1000 * t / 24)]; }}"
    )
    values = np.array([values_of(angles) for angles in truth])
    for time, expected in ((1, values[0]), (2.5, (values[1] + values[2]) / 2), (4, values[0])):
        assert page.evaluate(shown, time) == pytest.approx(expected, abs=np.radians(0.2))
    page.wait_for_function(f"() => Math.abs({PLAYER}.angles[0] - {values[:, 0].mean()}) < 1")
    button.click()
    assert button.text_content() == "Play" and page.evaluate(f"() => {PLAYER}.playing") is None
    assert page.locator("button.play").text_content() == "Play"


GOOD = table([seen(five_fingers.random_angles(1, 0.5))])
HEADER, ROW = GOOD.split("\n")
CELLS = ROW.split(",")
PLACES = seen(five_fingers.random_angles(1, 0.5)).tolist()
LINE = np.linspace([0.0, 0, 0], [0.1, 0.1, 0], 21)


def document(**changed: object) -> str:
    return json.dumps({"units": "m", "frames": [PLACES]} | changed)


@pytest.mark.parametrize(
    ("name", "text", "problem"),
    [
        ("empty.csv", "", "the file is empty"),
        ("angles.csv", "frame,MP2 [deg]\nf1,3\n", 'column 2 of the header is "MP2 [deg]", not'),
        ("short.csv", GOOD.replace(",PINKY_TIP_z [m]", ""), 'column 64 of the header is "", not '),
        ("inches.csv", GOOD.replace("[m]", "[inch]"), 'the unit is "inch"; give m, mm or px'),
        ("none.csv", HEADER, "there are no frames"),
        ("nan.csv", GOOD.replace(CELLS[5], "nan"), "row 2 (frame f0), THUMB_CMC is not three finite numbers"),
        ("cells.csv", f"{HEADER}\n{','.join(CELLS[:-1])}", "row 2 (frame f0) has 63 cells, not 64"),
        ("twice.csv", f"{GOOD}\n{ROW}", "row 3: 'f0' names another frame already"),
        ("zero.csv", f"{HEADER}\nf0{',0' * 63}", "all points are 0, 0, 0"),
        ("text.json", "{", "this is no JSON"),
        ("nothing.json", document(frames=[]), "frames are missing or empty"),
        ("points.json", document(frames=[PLACES[:20]]), "frame1 has 20 points; give 21"),
        ("null.json", document(frames=[[*PLACES[:20], None]]), "frame1, PINKY_TIP is not three finite"),
        ("same.json", document(frames=[[*PLACES[:20], PLACES[3]]]), "THUMB_IP and PINKY_TIP are at one"),
        ("hands.json", document(handedness="both"), 'handedness is "both"'),
    ],
    ids=lambda value: value if str(value).endswith((".csv", ".json")) else "",
)  # fmt: skip
def test_a_wrong_file_is_one_sentence_and_moves_nothing(page, tmp_path: Path, name, text, problem) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError):
        read_landmarks(tmp_path / name)
    said = opened(page, name, text)
    assert said.startswith(f"{name}: ") and problem in said and said.endswith(".")
    assert set(page.evaluate(f"() => [...{PLAYER}.angles]")) == {0}
    assert page.locator("button.tracked").is_disabled() and page.locator("input.frame").is_disabled()


def test_points_that_are_no_hand_are_refused_and_a_good_file_follows(page) -> None:
    assert "lie on a line" in opened(page, "line.csv", table([LINE]))
    shuffled = np.array(PLACES)[np.random.default_rng(0).permutation(21)]
    said = opened(page, "order.csv", table([seen(five_fingers.random_angles(1)), shuffled]))
    assert "order.csv: frame f1: the palm's landmarks are" in said and "MediaPipe's order" in said
    assert "1 frame." in opened(page, "good.csv", GOOD)
    assert not page.locator("button.tracked").is_disabled()


def test_a_subject_without_a_palm_takes_no_landmarks(browser, tmp_path: Path) -> None:
    hand = learn(three_bones.random_frames(10), three_bones.rig())
    write_player(tmp_path / "player.html", "finger", hand, three_bones.rig(), "right")
    page = patient(browser.new_context()).new_page()
    page.goto((tmp_path / "player.html").as_uri())
    page.wait_for_function(f"{PLAYER} !== undefined")
    assert page.locator("input.file").count() == 0
    assert "too little of a palm" in page.locator("aside").text_content()
    page.close()
