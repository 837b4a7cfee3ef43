"""The template hand that comes with handpipe, as a subject of either side takes it."""

import json
from pathlib import Path

import numpy as np
import pytest

from handpipe.anatomy.shipped import HAND, bones_of_part, fields_of, install
from handpipe.core import InputError
from handpipe.core.configuration import load_dataset
from handpipe.imaging.evidence import read_markers
from handpipe.mesh.files import read_surface
from handpipe.mesh.surfaces import Distance, concatenate

PALM = np.array([0.0, 0.0, -1.0])  # of the template's frame, as docs/anatomy.md states it


@pytest.fixture(scope="module", params=["right", "left"])
def hand(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    return folder, install(folder, request.param)


def test_bones_and_organs_are_closed_and_face_outwards(hand) -> None:
    folder, fields = hand
    assert {k: len(v) for k, v in fields.items()} == {
        "bones": 23,
        "joints": 22,
        "muscles": 17,
        "ligaments": 10,
        "tendons": 10,
        "nails": 5,
    }
    for kind in ("bones", "muscles", "ligaments"):
        for entry in fields[kind].values():
            assert read_surface(folder / entry["template"], closed=True).volume() > 0


def test_muscles_attach_to_the_bones_that_they_touch(hand) -> None:
    folder, fields = hand
    bones = {n: Distance(read_surface(folder / b["template"])) for n, b in fields["bones"].items()}
    gaps = {}
    for name, entry in (*fields["muscles"].items(), *fields["ligaments"].items()):
        surface = read_surface(folder / entry["template"])
        for bone, ids in json.loads((folder / entry["attachments"]).read_text()).items():
            assert len(ids) >= 3
            gaps[name, bone] = bones[bone].closest(surface.vertices[ids])[0].mean()
    far = {name for (name, _), gap in gaps.items() if gap > 2.0}
    assert far == {f"lumbrical{i}" for i in range(1, 5)}  # these begin on tendons


def test_tendons_begin_at_their_bones_and_pass_outside(hand) -> None:
    folder, fields = hand
    surfaces = {n: read_surface(folder / b["template"]) for n, b in fields["bones"].items()}
    everything = Distance(concatenate([*surfaces.values()]))
    for entry in fields["tendons"].values():
        path, _ = read_markers(folder / entry["path"])
        assert Distance(surfaces[entry["bones"][0]]).closest(path[:1])[0][0] < 3.0
        assert everything.signed(path[1:])[0].min() > 0.0


def test_flexion_bends_towards_the_palm_of_either_hand(hand) -> None:
    folder, fields = hand
    for name, joint in fields["joints"].items():
        if not joint["angles"] or name == "TM":  # the thumb's axes are oblique to the palm
            continue
        child = read_surface(folder / fields["bones"][joint["child"]]["template"]).vertices
        parent = read_surface(folder / fields["bones"][joint["parent"]]["template"]).vertices
        outwards = child.mean(axis=0) - parent.mean(axis=0)
        moves = np.cross(joint["axis_hints"][0], outwards)
        finger = name not in ("MP1", "IP1")
        assert moves @ PALM > (0.5 * np.linalg.norm(outwards) if finger else 0.0)


def test_a_left_hand_is_the_mirror_image(tmp_path: Path) -> None:
    right, left = install(tmp_path / "right"), install(tmp_path / "left", "left")
    assert right["bones"] == left["bones"] and right["muscles"] == left["muscles"]
    for relative in ("bones/proximal3.ply", "muscles/opponens_pollicis.ply", "nails/nail1.ply"):
        a, b = (read_surface(tmp_path / side / relative) for side in ("right", "left"))
        np.testing.assert_allclose(a.vertices * [1, -1, 1], b.vertices)
        np.testing.assert_allclose(a.triangle_normals() * [1, -1, 1], b.triangle_normals(), atol=1e-6)


def test_labels_and_names_are_those_of_the_generated_hand() -> None:
    """So that motions and scenes of the one serve the other."""
    fields = json.loads((HAND / "fields.json").read_text())
    dataset = load_dataset(Path(__file__).parents[2] / "config/datasets/phantom-hand-complete.yaml")
    assert {n: b["label"] for n, b in fields["bones"].items()} == dataset.labels
    assert {n: j["angles"] for n, j in fields["joints"].items()} == {
        n: list(j.angles) for n, j in dataset.joints.items()
    }


def test_a_finger_has_what_lies_on_its_bones_alone(tmp_path: Path) -> None:
    bones = bones_of_part(fields_of(), ["index"])
    fields = install(tmp_path, "right", bones=bones)
    assert bones == ["metacarpal2", "proximal2", "middle2", "distal2"] == [*fields["bones"]]
    assert [*fields["joints"]] == ["MP2", "PIP2", "DIP2"]
    assert {*fields["muscles"]} == {"palmar_interosseous1", "lumbrical1"}  # the dorsal one needs metacarpal1
    assert {*fields["ligaments"]} == {"collateral_radial2", "collateral_ulnar2"} and [*fields["nails"]] == [
        "nail2"
    ]
    assert {n: t["bones"] for n, t in fields["tendons"].items()} == {
        "flexor2": ["distal2", "middle2", "proximal2", "metacarpal2"],
        "extensor2": ["distal2", "middle2", "proximal2", "metacarpal2"],
    }


def test_the_tendon_of_a_part_ends_with_its_bones(tmp_path: Path) -> None:
    install(tmp_path, "right", bones=bones_of_part(fields_of(), ["index"]))
    ends = read_surface(tmp_path / "bones/metacarpal2.ply").vertices[:, 0]  # x points distally
    short, _ = read_markers(tmp_path / "tendons/flexor2.mrk.json")
    whole, _ = read_markers(HAND / "tendons/flexor2.mrk.json")
    assert whole[-1, 0] < ends.min() - 10  # the whole hand's goes on to the wrist
    assert short[-1, 0] == pytest.approx(ends.min(), abs=5.0) and np.allclose(short[0], whole[0], atol=1e-3)


def test_the_wrist_has_the_carpals_and_metacarpals() -> None:
    whole = fields_of()
    bones = bones_of_part(whole, ["wrist"])
    assert {*bones} == {
        "capitate",
        "trapezoid",
        "hamate",
        "trapezium",
        *(f"metacarpal{i}" for i in range(1, 6)),
    }
    fields = fields_of(bones=bones)
    assert {n for n, j in fields["joints"].items() if j["angles"]} == {"TM", "CMC4", "CMC5"}
    assert {*fields["muscles"]} == {"opponens_pollicis", "opponens_digiti_minimi"}
    assert not fields["tendons"]


@pytest.mark.parametrize(
    ("names", "joints"),
    [
        (["hamate", "metacarpal4", "metacarpal5"], {"CMC4": "hamate", "CMC5": "hamate"}),
        (["trapezium", "metacarpal1"], {"TM": "trapezium"}),
        (["capitate", "hamate", "metacarpal5"], {"CMC5": "hamate", "fixed_hamate": "capitate"}),
        (
            ["capitate", "hamate", "metacarpal3"],
            {"fixed_capitate": "metacarpal3", "fixed_hamate": "metacarpal3"},
        ),
    ],
)
def test_a_part_without_the_hands_root_has_a_root_of_its_own(
    names: list[str], joints: dict[str, str]
) -> None:
    """Bones that move as one with the metacarpal III are fixed to one another where it is absent."""
    fields = fields_of(bones=bones_of_part(fields_of(), names))
    assert {n: j["parent"] for n, j in fields["joints"].items()} == joints


@pytest.mark.parametrize(
    ("names", "problem"), [(["toe"], "neither a finger"), (["index", "thumb"], "no joint")]
)
def test_a_part_is_of_known_bones_that_joints_connect(names: list[str], problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        bones_of_part(fields_of(), names)
