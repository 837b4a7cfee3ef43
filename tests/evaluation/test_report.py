"""The report of a tiny made-up subject: everything inside, nothing outside, what is missing left out."""

import base64
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from handpipe.core.configuration.anatomy import Bone, Joint
from handpipe.core.configuration.dataset import Dataset
from handpipe.core.configuration.pose import Pose
from handpipe.core.layers import Frame, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.evaluation import pictures
from handpipe.evaluation.build import Job
from handpipe.evaluation.report import PoseView, ReportInput, write_report
from handpipe.evaluation.table import skin_metrics, skin_rows
from handpipe.evaluation.viewer import view_data
from handpipe.hand import StoredFrames, write_frames
from handpipe.hand import frames as frames_module
from handpipe.hand.appearance import NAIL, colour
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.joint_tree import RigJoint
from handpipe.skeleton.joints.joints import JointFit
from handpipe.skeleton.joints.residual import Residual
from handpipe.skeleton.rig import HandDirections, Rig

BONES = ("metacarpal2", "proximal2")


def capsule(radius: float, low: float, high: float) -> Surface:
    mesh = trimesh.creation.capsule(height=high - low, radius=radius, count=[12, 12])
    turned = np.asarray(mesh.vertices)[:, [2, 0, 1]]  # along x; a cyclic change of axes keeps the orientation
    return Surface(turned + [low + 0.5 * (high - low), 0, 0], np.asarray(mesh.faces))


def shape(surface: Surface, shift: float) -> Shape:
    return Shape(surface.vertices, surface.vertices + [0, 0, shift], surface.triangles)


def simulated(name: str, shift: float):
    layers = {
        "bones": {BONES[0]: shape(capsule(4, 0, 40), shift), BONES[1]: shape(capsule(3, 50, 80), shift)},
        "muscles": {"lumbrical1": shape(capsule(2, 5, 30), shift - 6)},
        "skin": {"skin": shape(capsule(12, -5, 85), shift)},
    }
    bones = {b: RigidTransform(np.eye(3), np.array([0, 0, shift])) for b in BONES}
    return Frame(name, {"MP2_flexion": 0.1 * shift}, bones), layers


def rig() -> Rig:
    """A metacarpal and a phalanx along x, which flexes about y."""
    still = Residual(np.zeros((2, 3)), np.zeros(1), np.zeros(1))
    fit = JointFit(
        Axes(np.array([[0.0, 1, 0]]), (0,)), np.array([45.0, 0, 0]), still, still, np.zeros((0, 1))
    )
    joint = RigJoint("MP2", *BONES, ("MP2_flexion",), np.radians([[-20.0, 90.0]]), fit)
    return Rig(BONES[0], (joint,), {BONES[0]: capsule(4, 0, 40), BONES[1]: capsule(3, 50, 80)}, {})


@pytest.fixture
def dataset() -> Dataset:
    return Dataset(
        name="tiny",
        root=Path("nowhere"),
        poses={
            n: Pose(role=r, volume="v", seeds="s") for n, r in {"flat": "neutral", "fist": "example"}.items()
        },
        bones={b: Bone(label=i + 1) for i, b in enumerate(BONES)},
        joints={
            "MP2": Joint(
                parent=BONES[0],
                child=BONES[1],
                angles=("MP2_flexion",),
                limits_deg=((-20, 90),),
                axis_hints=((0, 1, 0),),
            )
        },
    )


@pytest.fixture
def full(dataset: Dataset) -> ReportInput:
    frame, layers = simulated("fist", 3.0)
    scan = capsule(12.5, -5, 85).moved(capsule(12.5, -5, 85).vertices + [0, 0, 3])
    pose = PoseView(frame, layers, "example", lambda p: p[:, 0], scan, {"skin": [scan]})
    distances = {"fist": {"m0": np.array([0.1, 0.3]), "m2": np.array([1.0, 3.0])}}
    skin = skin_rows(distances, {"fist": "example"})
    return ReportInput(
        dataset,
        rig(),
        [pose],
        made={"made on": "2001-02-03", "commit": "abcdef"},
        inputs={"scans/fist.ply": "0123456789"},
        skin_rows=skin,
        muscle_rows=[{"muscle": "adductor", "pose": "flat", "role": "example", "mean": 0.37}],
        rig_rows=[{"joint": "MP2", "FM_R": 1.58, "PM_R": 1.82, "FM_x": 0.55, "PM_x": 0.76}],
        metrics={
            "rig": {"rotation_error_mean": (1.58, "deg")},
            "skin": skin_metrics(skin) | {"seconds": (12.5, "s"), "peak_memory": (0.75, "GiB")},
        },
        scenes={"close": [simulated("a", 0.0), simulated("b", 5.0)]},
        jobs=[Job("fit_rig", 4.0, 3.0, 0.5, 100.0)],
        settings={"material": "stable neo-Hookean"},
        limits=["Frames between examples are <interpolated>."],
        job_warnings={
            "make_skin": ["a bridge <was> cut"],
            "simulate": ["close/0: a muscle folds", "close/1: so"],
        },
    )


class Page(HTMLParser):
    """Attributes of tags, text, and whether tags close in order."""

    VOID = {"meta", "img", "input", "br", "link"}

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict]] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_report_is_one_well_formed_file_without_links(full: ReportInput, tmp_path: Path):
    write_report(tmp_path / "report.html", full)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert not page.open
    assert (
        re.search(
            r"(https?:)?//[a-z]+\.", re.sub(r"base64,[A-Za-z0-9+/=]+|\"[A-Za-z0-9+/=]{200,}\"", "", text)
        )
        is None
    )
    for tag, attributes in page.tags:
        for key in ("src", "href"):
            if attributes.get(key):
                assert attributes[key].startswith(("data:", "#"))
        assert not (tag == "link" or "@import" in text)


def test_report_holds_pictures_with_text_and_figures_with_units(full: ReportInput, tmp_path: Path):
    write_report(tmp_path / "report.html", full)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    images = [a for t, a in Page(text).tags if t == "img"]
    assert len(images) == 4 and all(a["alt"] for a in images)
    for image in images:
        assert base64.b64decode(image["src"].removeprefix("data:image/png;base64,")).startswith(b"\x89PNG")
    for expected in (
        "FM_R [deg]",
        "1.58",
        "0.76",
        "mean m2 [mm]",
        "Muscles against truth",
        "2.00",
        "12.50",
        "fit_rig",
        "MP2 flexion 17°",
        "Seen from the ulnar side",
        "on 2001-02-03, commit abcdef",
        "scans/fist.ply",
        "0123456789",
        "Warnings of jobs: 3",
        "a bridge &lt;was&gt; cut",
        "close/1: so",
    ):
        assert expected in text
    assert "&lt;interpolated&gt;" in text and "stable neo-Hookean" in text


def test_frames_of_a_scene_are_read_once_for_the_view_and_one_for_the_picture(
    dataset: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    files, read = [tmp_path / f"frames-{i}.h5" for i in range(6)], []
    for i, file in enumerate(files):
        write_frames(file, [simulated(f"f{i}", float(i == 3))])
    original = frames_module.read_frames
    monkeypatch.setattr(frames_module, "read_frames", lambda path: read.append(path) or original(path))
    report = ReportInput(dataset, rig=rig(), scenes={"long": StoredFrames(files)})
    write_report(tmp_path / "report.html", report, tmp_path / "pictures")
    ends = [files[0], files[-1]]  # the view tells by them how many frames it takes
    assert sorted(read) == sorted([*files, *ends, files[3]])
    assert (tmp_path / "pictures/long-skin.png").is_file()


def test_report_of_a_bare_dataset_leaves_sections_out(dataset: Dataset, tmp_path: Path):
    write_report(tmp_path / "report.html", ReportInput(dataset))
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "tiny" in text
    ids = [a.get("id") for _, a in Page(text).tags if a.get("id")]
    assert ids == ["subject"]


def test_pose_without_skin_image_and_truth_still_has_pictures(dataset: Dataset, tmp_path: Path):
    frame, layers = simulated("flat", 0.0)
    bare = PoseView(frame, {"bones": layers["bones"]}, "neutral")
    write_report(tmp_path / "report.html", ReportInput(dataset, rig(), [bare]))
    images = [a for t, a in Page((tmp_path / "report.html").read_text(encoding="utf-8")).tags if t == "img"]
    assert len(images) == 2


def test_scanner_frame_is_brought_to_the_simulations():
    frame, layers = simulated("flat", 0.0)
    turn = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
    root = RigidTransform(turn, np.array([5.0, -2, 9]))
    skin = capsule(12, -5, 85)
    in_scanner = skin.moved(root(skin.vertices))
    view = PoseView.from_scanner(
        frame, layers, "example", root, lambda p: p[:, 2], in_scanner, {"skin": [in_scanner]}
    )
    assert view.scan is not None and view.sample is not None
    np.testing.assert_allclose(view.scan.vertices, skin.vertices, atol=1e-12)
    np.testing.assert_allclose(view.truth["skin"][0].vertices, skin.vertices, atol=1e-12)
    np.testing.assert_allclose(view.sample(skin.vertices), in_scanner.vertices[:, 2], atol=1e-12)


def test_view_data_gives_back_positions_of_every_frame():
    frames = [simulated("a", 0.0), simulated("b", 5.0)]
    data = json.loads(json.dumps(view_data(frames)))
    assert data["frames"] == ["a", "b"] and data["views"] == {}
    for body, shape_a, shape_b in zip(
        data["bodies"],
        (s for shapes in frames[0][1].values() for s in shapes.values()),
        (s for shapes in frames[1][1].values() for s in shapes.values()),
        strict=True,
    ):
        integers = np.frombuffer(base64.b64decode(body["positions"]), "<u2").reshape(2, -1, 3)
        positions = np.array(data["low"]) + data["scale"] * integers
        np.testing.assert_allclose(positions[0], shape_a.vertices, atol=data["scale"])
        np.testing.assert_allclose(positions[1], shape_b.vertices, atol=data["scale"])
    assert data["scale"] < 0.005


def test_decimated_view_stays_on_the_surface():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=10)
    rest = np.asarray(ball.vertices)
    layers = [{"bones": {"b": Shape(rest, rest * f, np.asarray(ball.faces))}} for f in (1.0, 2.0)]
    data = view_data([(Frame(str(i), {}, {}), x) for i, x in enumerate(layers)], triangles=800)
    body = data["bodies"][0]
    assert len(base64.b64decode(body["triangles"])) == pytest.approx(800 * 12, rel=0.02)
    integers = np.frombuffer(base64.b64decode(body["positions"]), "<u2").reshape(2, -1, 3)
    radii = np.linalg.norm(np.array(data["low"]) + data["scale"] * integers, axis=-1)
    np.testing.assert_allclose(radii[0], 10, atol=0.05)
    np.testing.assert_allclose(radii[1], 20, atol=0.1)


def test_nails_of_a_decimated_skin_keep_their_place_and_colour():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=10)
    rest = np.asarray(ball.vertices)
    nail = (rest[:, 2] > 5).astype(np.uint8)
    skin = Shape(rest, rest, np.asarray(ball.faces), {"nail": nail})
    [body] = view_data([(Frame("a", {}, {}), {"fat": {"skin": skin}})], triangles=200)["bodies"]
    height = np.frombuffer(base64.b64decode(body["positions"]), "<u2").reshape(-1, 3)[:, 2] / 65535 * 20 - 10
    colours = np.frombuffer(base64.b64decode(body["colours"]), "u1").reshape(-1, 3) / 255
    assert len(colours) == len(height) < len(rest) / 2
    edge = 1.5  # mm: an edge of the fine triangles, across which colours blend
    for place, srgb in ((height > 5 + edge, NAIL), (height < 5 - edge, colour("skin"))):
        assert place.any()
        np.testing.assert_allclose(colours[place], np.tile(srgb, (place.sum(), 1)), atol=0.5 / 255)


def test_a_long_scene_keeps_its_first_and_last_frame_and_says_how_many_it_has():
    frames = [simulated(f"f{i}", 0.1 * i) for i in range(40)]
    vertices = sum(len(s.vertices) for shapes in frames[0][1].values() for s in shapes.values())
    data = view_data(frames, size=12 * 6 * vertices)
    assert len(data["frames"]) == 12 and data["total"] == 40
    assert data["frames"][0] == "f0" and data["frames"][-1] == "f39"
    count = len(np.frombuffer(base64.b64decode(data["bodies"][0]["positions"]), "<u2")) // 36
    assert count == len(frames[0][1]["bones"][BONES[0]].vertices)


def test_views_follow_the_metacarpal_in_every_frame():
    bent = Rotation.from_rotvec([0, np.pi / 2, 0]).as_matrix()
    (first, layers), (second, _) = simulated("a", 0.0), simulated("b", 0.0)
    second = Frame("b", {}, {BONES[0]: RigidTransform(bent, np.zeros(3))})
    data = view_data(
        [(first, layers), (second, layers)], HandDirections(*np.eye(3)[[0, 2, 1]], bone=BONES[0])
    )
    np.testing.assert_allclose(data["views"]["palm"], [[0, 0, -1, 1, 0, 0], [-1, 0, 0, 0, 0, -1]], atol=1e-5)
    np.testing.assert_allclose(data["views"]["thumb"], [[0, 1, 0, 1, 0, 0], [0, 1, 0, 0, 0, -1]], atol=1e-5)


def test_every_pose_is_drawn_and_slices_have_anatomical_names(full, monkeypatch, tmp_path: Path):
    drawn = []
    figure = pictures.slices_figure

    def watched(sample, planes, contours):
        drawn.append(planes)
        return figure(sample, planes, contours)

    monkeypatch.setattr(pictures, "slices_figure", watched)
    frame, layers = simulated("spread", 1.0)
    full.poses = [*full.poses, PoseView(frame, layers, "heldout")]
    write_report(tmp_path / "report.html", full)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<h3>spread <small>(heldout)</small></h3>" in text and "spread (heldout)" in text
    for planes in drawn:
        assert list(planes) == ["sagittal", "coronal", *(f"transversal, {b}" for b in BONES)]
        for name, across in (("sagittal", 1), ("coronal", 2), (f"transversal, {BONES[0]}", 0)):
            assert abs(planes[name].normal[across]) == pytest.approx(1, abs=0.02)
    assert len(drawn) == 2


def test_axes_take_the_place_of_directions_only_with_a_warning(dataset: Dataset, tmp_path: Path):
    frame, layers = simulated("flat", 0.0)
    write_report(tmp_path / "report.html", ReportInput(dataset, None, [PoseView(frame, layers, "neutral")]))
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "No joint of this subject tells its anatomical directions" in text and "ulnar" not in text


def test_a_muscle_is_not_drawn_twice():
    """Its surface and its tetrahedra would cover each other in blotches."""
    frame, layers = simulated("a", 0.0)
    layers["muscles"]["lumbrical1_mesh"] = layers["muscles"]["lumbrical1"]
    layers["muscles"]["lone_mesh"] = shape(capsule(2, 0, 9), 0)
    names = [body["name"] for body in view_data([(frame, layers)])["bodies"]]
    assert names == [*BONES, "lumbrical1", "lone_mesh", "skin"]
