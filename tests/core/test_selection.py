"""A stage sees the fields that its rule declares, and no others."""

import json
from pathlib import Path

import pytest

from handpipe.core.configuration.dataset import Dataset, load_dataset
from handpipe.core.configuration.model import UndeclaredFieldError
from handpipe.core.configuration.pose import Role
from handpipe.core.configuration.selection import restored, select

FINGER = Path(__file__).parents[2] / "config" / "datasets" / "phantom-finger.yaml"


@pytest.fixture(scope="module")
def finger() -> Dataset:
    return load_dataset(FINGER)


def part(finger: Dataset, *fields: str, **names: str | tuple[str, ...]) -> Dataset:
    return restored(select(finger, fields, **names), Dataset)


def test_everything_is_the_dataset(finger: Dataset) -> None:
    assert part(finger, "*") == finger


def test_declared_fields_have_their_types(finger: Dataset) -> None:
    found = part(finger, "root", "joints", "poses.*.role", "truth", "scanner")
    assert found.joints == finger.joints
    assert found.truth == finger.truth
    assert found.scanner is None
    assert (found.neutral, found.examples) == (finger.neutral, finger.examples)
    assert found.poses["fist"].role is Role.example
    assert found.path(Path("x")) == finger.path(Path("x"))


@pytest.mark.parametrize(
    "read",
    [
        lambda d: d.seed,
        lambda d: d.fleshed,
        lambda d: d.bones,
        lambda d: d.poses["fist"].volume,
        lambda d: d.tendons["flexor2"].radius,
        lambda d: d.tendons["extensor2"],
        lambda d: list(d.tendons),
        lambda d: len(d.tendons),
        lambda d: "flexor2" in d.tendons,
        lambda d: {**d.tendons},
        lambda d: dict(d.tendons),
        lambda d: d.muscles["lumbrical1"].template,
    ],
)
def test_what_is_not_declared_raises(finger: Dataset, read) -> None:
    found = part(finger, "poses.*.role", "tendons.{tendon}.bones", "muscles.names", tendon="flexor2")
    with pytest.raises(UndeclaredFieldError):
        read(found)


def test_entries_by_name_and_by_several_names(finger: Dataset) -> None:
    found = part(
        finger, "poses.names", "poses.{examples}.scan", "tendons.{t}", t="flexor2", examples=("fist",)
    )
    assert list(found.poses) == list(finger.poses)
    assert found.poses["fist"].scan == finger.poses["fist"].scan
    assert found.tendons["flexor2"] == finger.tendons["flexor2"]
    with pytest.raises(UndeclaredFieldError, match="scan"):
        _ = found.poses["hook"].scan


def test_text_changes_with_declared_fields_and_with_order_alone(finger: Dataset) -> None:
    def text(dataset: Dataset) -> str:
        return select(dataset, ["bones.*.label"])

    renamed = finger.model_copy(update={"seed": 7, "joints": {}})
    turned = finger.model_copy(update={"bones": dict(reversed(finger.bones.items()))})
    labelled = finger.bones["distal2"].model_copy(update={"label": 9})
    other = finger.model_copy(update={"bones": {**finger.bones, "distal2": labelled}})
    assert text(renamed) == text(finger)
    assert text(turned) != text(finger)
    assert text(other) != text(finger)
    assert json.loads(text(finger))["values"]["bones"]["distal2"] == {"label": finger.bones["distal2"].label}


def test_a_field_that_no_model_has_is_refused(finger: Dataset) -> None:
    with pytest.raises(ValueError, match="Bone has no field lable"):
        select(finger, ["bones.*.lable"])


def test_what_follows_from_fields_can_be_read_without_them(finger: Dataset) -> None:
    found = part(finger, "neutral", "examples", "fleshed", "root_bone")
    assert (found.neutral, found.examples) == ("neutral", finger.examples)
    assert found.fleshed is True
    assert found.root_bone == "metacarpal2"
    with pytest.raises(UndeclaredFieldError):
        _ = found.heldout
