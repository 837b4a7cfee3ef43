"""Feature points: files, missing ones, doubtful ones, and those that bones have."""

import numpy as np
import pytest
from tests.anatomy.hand_templates import phantom, real_hands

from handpipe.anatomy.person import feature_points as fp
from handpipe.anatomy.person.bony_points import KNUCKLE, bony_feature_points
from handpipe.core.errors import InputError
from handpipe.imaging.evidence.markers import write_markers
from handpipe.mesh.surfaces.distance import Distance

PERSON = np.array([[1.08, 0.05, 0.0], [-0.03, 0.95, 0.02], [0.0, 0.04, 1.1]])


@pytest.fixture(scope="module")
def source() -> dict[str, np.ndarray]:
    """The phantom's points and a wrist, 26 in all."""
    wrist = {"wrist_radial": [-22.0, 24, -8], "wrist_ulnar": [-24.0, -26, -4], "ulna_head": [-30.0, -20, 9]}
    return phantom().feature_points | {n: np.array(p) for n, p in wrist.items()}


def person(source, spread: float = 1.0) -> dict[str, np.ndarray]:
    """Another person's hand: other proportions, a bend, and points that are `spread` mm off."""
    rng = np.random.default_rng(3)
    return {
        n: PERSON @ p + [4.0, 1, 2] - [0, 0, 0.0006 * p[0] ** 2] + spread * rng.standard_normal(3)
        for n, p in source.items()
    }


def test_there_are_26_names_and_the_file_returns_what_was_written(tmp_path, source):
    assert len(fp.NAMES) == len(set(fp.NAMES)) == 26 == len(source)
    fp.write(tmp_path / "points.mrk.json", source)
    again = fp.read(tmp_path / "points.mrk.json")
    assert list(again) == list(fp.NAMES)
    for name, point in source.items():
        assert again[name] == pytest.approx(point)


def test_missing_points_are_named_and_sixteen_suffice(tmp_path, source):
    fewer = {
        n: p for n, p in source.items() if not n.startswith(("web", "DIP")) and n not in ("MP5", "ulna_head")
    }
    assert len(fewer) == 16
    fp.write(tmp_path / "points.mrk.json", fewer)
    assert len(fp.read(tmp_path / "points.mrk.json")) == 16
    assert set(fp.missing(fewer)) == set(source) - set(fewer)


@pytest.mark.parametrize(
    ("kept", "match"),
    [
        (["tip1", "tip2", "tip3", "MP1", "MP5"], "only 5 of at least 8"),
        (["tip1", "tip2", "tip3", "tip5", "MP1", "MP2", "MP3", "MP5", "wrist_ulnar"], "ray 4 has no point"),
    ],
)
def test_too_few_points_are_refused(tmp_path, source, kept, match):
    fp.write(tmp_path / "points.mrk.json", {n: source[n] for n in kept})
    with pytest.raises(InputError, match=match):
        fp.read(tmp_path / "points.mrk.json")


def test_a_name_that_is_none_is_refused(tmp_path, source):
    write_markers(tmp_path / "points.mrk.json", np.zeros((2, 3)), ["tip1", "thumb"])
    with pytest.raises(InputError, match="'thumb' is no feature point"):
        fp.read(tmp_path / "points.mrk.json")


@pytest.mark.parametrize("name", ["tip2", "PIP3", "MP4", "web23", "wrist_radial", "DIP5"])
def test_a_point_20_mm_off_is_named(source, name):
    target = person(source)
    assert fp.doubtful(source, target) == {}
    away = np.random.default_rng(len(name)).standard_normal(3)
    wrong = target | {name: target[name] + 20 * away / np.linalg.norm(away)}
    found = fp.doubtful(source, wrong)
    assert list(found) == [name] and found[name] == pytest.approx(20, abs=6)
    with pytest.raises(InputError, match=f"{name} lies [0-9]+ mm from where"):
        fp.require_plausible(source, wrong, "points.mrk.json")


def test_two_names_that_are_mixed_up_are_found(source):
    target = person(source)
    mixed = target | {"tip2": target["tip4"], "tip4": target["tip2"]}
    assert set(fp.doubtful(source, mixed)) == {"tip2", "tip4"}


def test_a_childs_point_12_mm_off_is_as_doubtful(source):
    """The limit is of an adult's hand."""
    child = {n: 0.6 * p for n, p in person(source).items()}
    wrong = child | {"tip3": child["tip3"] + [0.0, 12.0, 0.0]}
    assert list(fp.doubtful(source, wrong)) == ["tip3"]


def test_knuckles_lie_on_the_back_over_the_bone():
    hand = phantom()
    for joint in hand.joints:
        if joint.name[:-1] not in ("MP", "PIP", "DIP", "IP"):
            continue
        point = hand.feature_points[joint.name]
        away = Distance(hand.bones[joint.parent]).closest(point[None])[0][0]
        assert 0.8 * KNUCKLE < away <= KNUCKLE + 1e-3, joint.name
        # A bone that bends towards the palm leaves the knuckle behind.
        palm = np.cross(joint.axes[0], hand.bones[joint.child].vertices.mean(axis=0) - joint.centre)
        assert (point - joint.centre) @ palm < 0
        if joint.name[-1] != "1":
            assert (point - joint.centre)[2] > 2.5


def test_the_other_hand_has_mirrored_points():
    hand = phantom()
    left = hand.mirrored()
    found = bony_feature_points(left.bones, left.joints)
    for name, point in found.items():
        assert point == pytest.approx(hand.feature_points[name] * [1, -1, 1], abs=1e-3)


def test_two_persons_hands_have_no_doubtful_points():
    myohand, zanatomy = real_hands()
    assert fp.missing(myohand.feature_points) == fp.missing(zanatomy.feature_points) == ()
    assert fp.doubtful(myohand.feature_points, zanatomy.feature_points) == {}
    wrong = zanatomy.feature_points | {"PIP3": zanatomy.feature_points["PIP3"] + [0.0, 0.0, 20.0]}
    assert list(fp.doubtful(myohand.feature_points, wrong)) == ["PIP3"]
