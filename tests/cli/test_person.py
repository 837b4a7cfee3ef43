"""A hand of known sizes comes back from a picture of it, and from points in 3D; wrong input is refused."""

import json
from pathlib import Path

import numpy as np
import pygltflib
import pytest
from scipy.spatial.transform import Rotation

from handpipe.anatomy.person import SubjectTemplate, feature_points, person_of_photograph, person_of_points
from handpipe.anatomy.person.family import lengths_of
from handpipe.anatomy.shipped import ShippedHand
from handpipe.cli import main
from handpipe.cli.own_files import LISTED
from handpipe.cli.person import making
from handpipe.cli.person.making import Asked, make
from handpipe.core import Frame, InputError
from handpipe.levels import LearnedHand
from handpipe.levels.mass_spring import Bulging, SpringHand
from handpipe.skeleton.rig import Rig
from handpipe.tissues.fat import Skin

from . import photographed

CONTRACTIONS = "contraction,time [frame],flexor_digitorum_profundus_2\nrest,0,0\nbent,3,0.6\n"


@pytest.fixture(scope="module")
def flat() -> dict[str, float]:
    return photographed.lying()[1].flat


def errors(found: SubjectTemplate, side: str = "right") -> dict[str, float]:
    """Lengths of bones over the true ones, less 1."""
    own, true = lengths_of(found), lengths_of(photographed.truth(side))
    return {bone: own[bone] / true[bone] - 1 for bone in true}


def fingers(lengths: dict[str, float]) -> np.ndarray:
    """Lengths (5,) of the phalanges of each ray together."""
    return np.array(
        [sum(v for b, v in lengths.items() if b[-1] == ray and b[:4] != "meta") for ray in "12345"]
    )


@pytest.mark.parametrize("palm", [False, True])
@pytest.mark.parametrize("side", ["right", "left"])
def test_bones_of_a_photographed_hand_have_their_lengths(flat, side: str, palm: bool) -> None:
    template = ShippedHand.load(side).template
    shot = photographed.photograph(side, palm)
    found, lifted = person_of_photograph(template, shot, flat)
    away = errors(found, side)
    assert found.side == side and lifted.mirrored == palm
    assert max(abs(e) for bone, e in away.items() if bone[:4] != "meta") < 0.03
    assert max(map(abs, away.values())) < 0.06  # no point lies at the bases of metacarpals
    true, own = (fingers(lengths_of(some)) for some in (photographed.truth(side), found))
    assert own == pytest.approx(true, rel=0.02)
    assert fingers(lengths_of(template)) != pytest.approx(true, rel=0.12)
    assert found.skin.volume() == pytest.approx(photographed.truth(side).skin.volume(), rel=0.06)


def test_marks_of_a_millimetre_are_forgiven(flat) -> None:
    shot, rng = photographed.photograph(), np.random.default_rng(0)
    noise = rng.normal(0.0, photographed.PIXELS, (len(shot.points), 2))
    moved = {n: (x + a, y + b) for (n, (x, y)), (a, b) in zip(shot.points.items(), noise, strict=True)}
    found, _ = person_of_photograph(
        ShippedHand.load().template, shot.model_copy(update={"points": moved}), flat
    )
    assert max(map(abs, errors(found).values())) < 0.12
    assert fingers(lengths_of(found)) == pytest.approx(fingers(lengths_of(photographed.truth())), rel=0.04)


def test_the_template_comes_back_from_its_own_picture(flat) -> None:
    template = ShippedHand.load().template
    found = person_of_points(template, template.feature_points)
    assert np.abs(found.skin.vertices - template.skin.vertices).max() < 0.05
    for joint, own in zip(found.joints, template.joints, strict=True):
        assert joint.centre == pytest.approx(own.centre, abs=0.05)
        assert joint.axes == pytest.approx(own.axes, abs=1e-3)


def test_points_in_3d_give_the_hand_wherever_it_lies(tmp_path: Path) -> None:
    turn = Rotation.from_rotvec([0.4, -1.0, 2.0])
    lines = [
        f"{name},{x:.4f},{y:.4f},{z:.4f}"
        for name, point in photographed.lying()[0].items()
        for x, y, z in [turn.apply(point) + [100.0, -50.0, 20.0]]
    ]
    path = tmp_path / "points.csv"
    path.write_text("\n".join(["point,x,y,z", *lines]) + "\n", encoding="utf-8")
    found = person_of_points(ShippedHand.load().template, feature_points.read_table(path), origin=path)
    assert max(map(abs, errors(found).values())) < 0.08
    assert fingers(lengths_of(found)) == pytest.approx(fingers(lengths_of(photographed.truth())), rel=0.04)
    with pytest.raises(InputError, match="those of a right hand, not of a left one"):
        person_of_points(ShippedHand.load("left").template, feature_points.read_table(path), origin=path)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("photographed")
    (folder / "points.json").write_text(photographed.photograph("left").model_dump_json(), encoding="utf-8")
    (folder / "bend.csv").write_text(CONTRACTIONS, encoding="utf-8")
    found = make(Asked(folder / "points.json", folder / "hand", motions=[folder / "bend.csv"]))
    return folder / "hand", "\n".join(found.said)


def test_the_page_plays_the_springs(made) -> None:
    """The learned hand is as near to the springs (L2) as it states, in a pose that it has not learned."""
    folder, said = made
    assert "seconds from points to the page" in said
    rig, hand = Rig.load(folder / "rig.h5"), LearnedHand.load(folder / "levels.h5")
    template = SubjectTemplate.load(folder / "hand.h5")
    springs = SpringHand.of(
        rig, Skin.load(folder / "skin.h5"), [Bulging(n, m) for n, m in template.muscles.items()]
    )
    fist, flat = (rig.poses[name].angles for name in ("fist", "flat"))
    between = {name: 0.5 * (fist[name] + flat[name]) for name in rig.angle_names}
    angles = hand.angles_of(between)
    shapes = springs.frame(Frame("between", between, rig.bone_transforms(between)), judged=False)
    apart = hand.split(hand.vertices(angles, "L1"))["skin", "skin"] - shapes["skin"]["skin"].vertices
    away = np.linalg.norm(apart, axis=1)
    stated = hand.bodies["skin", "skin"].errors["L1"]
    assert away.max() < max(stated.largest, 3.0) and away.mean() < 2 * stated.mean
    moved = shapes["skin"]["skin"].vertices - template.skin.vertices
    assert np.linalg.norm(moved, axis=1).max() > 20
    page = (folder / "player.html").read_text(encoding="utf-8")
    assert "frames of springs (L2)" in page and 'value="fist"' in page


def test_contractions_move_the_hand_in_a_scene_for_other_programs(made) -> None:
    scene = pygltflib.GLTF2().load(str(made[0] / "bend.glb"))
    names = {mesh.name for mesh in scene.meshes}
    assert any("skin" in name for name in names) and any("adductor_pollicis" in name for name in names)
    skin = next(mesh for mesh in scene.meshes if "skin" in mesh.name)
    assert len(skin.primitives[0].targets) == 4


def test_a_folder_that_is_used_again_keeps_no_motion_of_the_earlier_hand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files of a hand are stood in for by what would be in them: whose points, and which motion."""

    def written(hand: object, asked: Asked, folder: Path) -> dict[str, float]:
        for name in ("player.html", "hand.h5", *(f"{motion.stem}.glb" for motion in asked.motions)):
            (folder / name).write_text(asked.points.name, encoding="utf-8")
        return {"player.html": 0.0}

    monkeypatch.setattr(making, "_written", written)
    for name in ("first.json", "second.json"):
        (tmp_path / name).write_text(photographed.photograph().model_dump_json(), encoding="utf-8")
    folder = tmp_path / "hand"
    make(Asked(tmp_path / "first.json", folder, motions=[tmp_path / "wave.csv"]))
    (folder / "points.json").write_text("{}", encoding="utf-8")  # as the page writes it
    made = make(Asked(tmp_path / "second.json", folder))
    assert [p.name for p in made.files] == ["player.html", "hand.h5"]
    assert {p.name for p in folder.iterdir()} == {"player.html", "hand.h5", "points.json", LISTED}
    assert all(p.read_text(encoding="utf-8") == "second.json" for p in made.files)


def changed(**further) -> str:
    """Points of a photograph with some fields replaced; None removes one."""
    fields = json.loads(photographed.photograph().model_dump_json()) | further
    return json.dumps({name: value for name, value in fields.items() if value is not None})


def fewer(count: int) -> dict:
    return dict([*photographed.photograph().points.items()][-count:])


def mixed(a: str, b: str, together: bool = False) -> dict:
    points = dict(photographed.photograph().points)
    points[a], points[b] = points[b], points[b] if together else points[a]
    return points


def misplaced(name: str, pixels: float) -> dict:
    points = dict(photographed.photograph().points)
    return points | {name: (points[name][0] + pixels, points[name][1])}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (lambda: changed(points=fewer(15)), "only 15 of at least 16 points. Place more of"),
        (lambda: changed(points=mixed("PIP3", "DIP3", together=True)), "PIP3, DIP3: lie at one place"),
        (lambda: changed(points=mixed("tip2", "tip5")), "Look whether names are mixed up"),
        (lambda: changed(points=misplaced("PIP3", 180.0)), "Look whether it is misplaced"),
        (lambda: changed(hand="left"), "show the back of a right hand, not of a left one"),
        (lambda: changed(ruler=None), "scale: ruler is missing"),
        (lambda: changed(distance=None), "scale: distance is missing"),
        (lambda: changed(distance=8.56), "ruler: makes the hand 0.09 times as large"),
        (lambda: changed(points={"thumb": [1, 2]}), "'thumb' is no feature point"),
        (lambda: "{", "YAML"),
    ],
)
def test_points_of_which_no_hand_can_be_made(tmp_path: Path, capsys, content, message: str) -> None:
    path = tmp_path / "points.json"
    path.write_text(content(), encoding="utf-8")
    code = main(["photograph", "--points", str(path), "--out", str(tmp_path / "hand"), "--no-browser"])
    said = capsys.readouterr().err.strip()
    assert code == 1 and said.count("handpipe: ") == 1 and len(said.splitlines()) == 1
    assert message in said and str(path) in said
    assert [p.name for p in tmp_path.iterdir()] == ["points.json"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("point,x,y\n", "header: is 'point,x,y'"),
        ("", "header"),
        ("point,x,y,z\nthumb,1,2,3\n", "row 1: 'thumb' is no feature point"),
        ("point,x,y,z\ntip1,1,2,3\ntip1,1,2,4\n", "row 2: 'tip1' stands twice"),
        ("point,x,y,z\ntip1,1,two,3\n", "row 1: tip1 has no three numbers"),
        ("point,x,y,z\ntip1,1,2,nan\n", "row 1: tip1 has no three numbers"),
        ("point,x,y,z\ntip1,1,2,3\ntip2,1,2,3\ntip3,9,2,3\n", "tip1, tip2: lie at one place"),
        ("point,x,y,z\ntip1,1,2,3\ntip2,9,2,3\n", "only 2 of at least 16 points"),
    ],
)
def test_tables_of_points_that_are_wrong(tmp_path: Path, capsys, content: str, message: str) -> None:
    path = tmp_path / "points.csv"
    path.write_text(content, encoding="utf-8")
    assert main(["photograph", "--points", str(path), "--out", str(tmp_path / "hand")]) == 1
    assert message in capsys.readouterr().err
    assert not (tmp_path / "hand").exists()


def test_pictures_that_cannot_be_read(tmp_path: Path, capsys) -> None:
    path = tmp_path / "hand.jpg"
    path.write_bytes(b"no picture")
    assert main(["photograph", str(path), "--out", str(tmp_path / "hand")]) == 1
    assert "hand.jpg: picture: cannot be read. Give the picture as JPEG" in capsys.readouterr().err
    assert main(["photograph", str(tmp_path / "none.png"), "--out", str(tmp_path / "hand")]) == 1
    assert "none.png: picture: does not exist" in capsys.readouterr().err
    assert main(["photograph", "--out", str(tmp_path / "hand")]) == 1
    assert "PICTURE: is missing" in capsys.readouterr().err
    assert not (tmp_path / "hand").exists()
