"""A scene that names bones has these, the bones that carry them, and the organs on them alone."""

import json
from pathlib import Path

import pytest

from handpipe.core.configuration.dataset import Dataset, load_dataset
from handpipe.core.configuration.scene import Scene
from handpipe.core.errors import InputError
from handpipe.hand.part import bones_of, part_of

DATASETS = Path(__file__).parents[2] / "config" / "datasets"
SCENE = Path("config/scenes/s.yaml")
INDEX = ["metacarpal2", "proximal2", "middle2", "distal2"]


def scene(only, *layers):
    return Scene(layers=layers or ("bones",), frames="x.csv", only=only)


@pytest.fixture(scope="module")
def hand():
    """The whole hand with seeds of every pose, its files nowhere."""
    content = load_dataset(DATASETS / "phantom-hand-complete.yaml").model_dump()
    for name, pose in content["poses"].items():
        pose["seeds"] = f"seeds/{name}.nii.gz"
    return Dataset.model_validate(content)


@pytest.fixture
def with_attachments(hand, tmp_path):
    """The hand with one muscle on the index finger and one that goes on to the thumb."""
    muscles = dict.fromkeys(hand.muscles)
    first, second = list(muscles)[:2]
    for name, bones in {first: ["metacarpal2", "proximal2"], second: ["metacarpal1", "proximal2"]}.items():
        (tmp_path / f"{name}.json").write_text(json.dumps({bone: [0] for bone in bones}))
    content = hand.model_dump() | {"root": tmp_path, "ligaments": {}}
    content["muscles"] = {n: {"template": f"{n}.ply", "attachments": f"{n}.json"} for n in (first, second)}
    return Dataset.model_validate(content)


@pytest.mark.parametrize(
    ("only", "expected"),
    [
        (["index"], INDEX),
        (["distal2"], INDEX),
        (["proximal2"], INDEX[:2]),
        (["proximal2", "middle2"], INDEX[:3]),
    ],
)
def test_bones_come_with_those_that_carry_them(hand, only, expected):
    found = bones_of(SCENE, hand, only)
    carriers = {joint.child: joint.parent for joint in hand.joints.values()}
    assert set(expected) <= set(found)
    assert all(bone == hand.root_bone or carriers[bone] in found for bone in found)
    assert not {bone for bone in found if bone.endswith(("1", "4", "5"))}


def test_a_scene_without_choice_has_the_whole_hand(hand):
    part = part_of({SCENE: scene(None, "fat")}, Path("d.yaml"), hand)
    assert part.dataset is hand and part.left_out == {}


def test_all_bones_by_name_are_the_whole_hand(hand):
    part = part_of({SCENE: scene(tuple(hand.bones), "fat")}, Path("d.yaml"), hand)
    assert part.dataset is hand


def test_a_part_has_no_skin_and_knows_the_labels_of_all_bones(hand):
    part = part_of({SCENE: scene(("index",))}, Path("d.yaml"), hand).dataset
    assert part.seed_labels.items() == hand.labels.items()
    assert part.bones.keys() & {"distal3", "distal1"} == set()
    assert not part.fleshed and part.nails == {}
    assert {j.child for j in part.joints.values()} == part.bones.keys() - {part.root_bone}
    assert hand.fleshed


@pytest.mark.parametrize(
    ("only", "tendons"), [(("index",), []), (("index", "capitate"), ["flexor2", "extensor2"])]
)
def test_tendons_lie_on_bones_of_the_part(hand, only, tendons):
    """Each of them begins at the capitate."""
    found = part_of({SCENE: scene(only, "tendons")}, Path("d.yaml"), hand)
    assert list(found.dataset.tendons) == tendons
    assert {*tendons, *found.left_out["tendons"]} == set(hand.tendons)
    assert found.left_out["tendons"].get("flexor2", ("capitate",)) == ("capitate",)
    assert ("flexor2 (capitate)" in str(found)) == (not tendons)


def test_muscles_lie_on_bones_of_the_part(with_attachments):
    first, second = with_attachments.muscles
    part = part_of({SCENE: scene(("index",), "muscles")}, Path("d.yaml"), with_attachments)
    assert list(part.dataset.muscles) == [first]
    assert part.left_out == {"muscles": {second: ("metacarpal1",)}}


@pytest.mark.parametrize("layer", ["fat", "skin"])
def test_layers_of_the_whole_skin_are_refused(hand, layer):
    with pytest.raises(InputError, match=rf"s\.yaml: layers: {layer} is made of the skin around all bones"):
        part_of({SCENE: scene(("index",), layer)}, Path("d.yaml"), hand)


def test_seeds_that_are_proposed_are_refused(hand):
    content = hand.model_dump()
    content["poses"]["fist"]["seeds"] = None
    with pytest.raises(InputError, match=r"d\.yaml: poses\.fist\.seeds: is not given"):
        part_of({SCENE: scene(("index",))}, Path("d.yaml"), Dataset.model_validate(content))


def test_scenes_of_different_bones_are_refused(hand):
    scenes = {Path("a.yaml"): scene(("index",)), Path("b.yaml"): scene(None)}
    with pytest.raises(InputError, match=r"b\.yaml: only: models metacarpal1"):
        part_of(scenes, Path("d.yaml"), hand)


def test_attachments_that_are_not_made_yet_are_named(hand):
    with pytest.raises(InputError, match="is not made yet, and tells which organs lie on the bones"):
        part_of({SCENE: scene(("index",), "muscles")}, Path("d.yaml"), hand)


@pytest.mark.parametrize("only", [("toe",), ("metacarpal9",)])
def test_unknown_names_are_refused(hand, only):
    with pytest.raises(InputError, match=r"only: '\w+' is neither a bone"):
        bones_of(SCENE, hand, only)


def test_a_root_alone_is_refused(hand):
    with pytest.raises(InputError, match="no joint moves"):
        bones_of(SCENE, hand, [hand.root_bone])
