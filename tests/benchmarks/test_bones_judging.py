"""What counts as good: an error that is noticed and kept from the rig; nothing else that is wrong."""

from dataclasses import replace

import pytest
from benchmarks.bones.cases import CASES
from benchmarks.bones.hard_cases import Row, cells, judge
from benchmarks.bones.outcome import BoneErrors, Outcome
from benchmarks.marked_parts import between

CASE = CASES["five-poses"]
POSES = ("neutral", "fist", "hook", "spread")
BONES = ("proximal2", "middle2", "distal2")
RIGHT = BoneErrors(0.98, 0.1, 0.02, (0.1, 0.02))
WRONG = BoneErrors(0.2, 150.0, 20.0, (0.2, 0.03))
PLACE = ("hook", "middle2")


def outcome(**changes) -> Outcome:
    """All is right but for what is changed."""
    errors = {(pose, bone): RIGHT for pose in POSES for bone in BONES}
    errors |= {("neutral", bone): BoneErrors(0.98, None, None) for bone in BONES}
    rig = {
        f"{prefix}{kind}_error_mean": (0.1, unit)
        for prefix in ("", "loo_")
        for kind, unit in (("rotation", "deg"), ("translation", "mm"))
    }
    return replace(Outcome(errors, {}, rig, [], frozenset(), 1.0), **changes)


def with_wrong(errors: BoneErrors = WRONG, **changes) -> Outcome:
    return outcome(errors=outcome().errors | {PLACE: errors}, **changes)


def judged(found: Outcome) -> Row:
    return judge(CASE, found)


def test_right_bones_are_good() -> None:
    assert judged(outcome()).failures == []
    assert judged(outcome()).motion_mean == pytest.approx((0.1, 0.02))


def test_an_error_has_to_be_noticed_and_kept_from_the_rig() -> None:
    said, left_out = {PLACE: ["middle2 is in doubt"]}, frozenset({PLACE})
    good = judged(with_wrong(said=said, left_out=left_out))
    assert good.failures == [] and good.noticed == 1 and len(good.wrong) == 1
    assert any("not noticed" in f for f in judged(with_wrong(left_out=left_out)).failures)
    assert any("passed on" in f for f in judged(with_wrong(said=said)).failures)


def test_a_bone_that_is_not_found_has_to_be_spoken_of() -> None:
    nothing = BoneErrors(None, None, None)
    assert judged(with_wrong(nothing, left_out=frozenset({PLACE}))).failures
    told = with_wrong(nothing, left_out=frozenset({PLACE}), said={PLACE: ["middle2 is missing"]})
    assert judged(told).failures == []


def test_an_uncertainty_that_covers_the_error_is_a_notice() -> None:
    off = BoneErrors(0.98, 1.6, 0.02, (1.0, 0.02))
    assert judged(with_wrong(off)).failures == []
    assert judged(with_wrong(replace(off, stated=(0.1, 0.02)))).failures
    # A bone that was badly segmented is wrong however unsure its registration says it is.
    assert judged(with_wrong(replace(off, dice=0.5))).failures


def test_false_alarms_and_bars() -> None:
    said = {("fist", bone): ["doubted"] for bone in BONES}
    assert judged(outcome(said=said)).alarms == 3
    assert any("false alarms" in f for f in judged(outcome(said=said)).failures)
    assert "no fitted rig" in judged(outcome(rig={})).failures
    low = {place: replace(e, dice=0.95) for place, e in outcome().errors.items()}
    assert any("Dice" in f for f in judged(outcome(errors=low)).failures)


def test_failures_are_shown() -> None:
    assert cells(judged(outcome()))[1] == "good"
    assert cells(judged(with_wrong()))[1].startswith("**fails**")


def test_a_document_keeps_what_is_outside_the_markers() -> None:
    text = "a\n<!-- part: python -m benchmarks.bones -->\nold\n<!-- end of part -->\nb"
    new = between(text, "part", "python -m benchmarks.bones", "new")
    assert new.startswith("a\n") and new.endswith("\nb") and "new" in new and "old" not in new
    with pytest.raises(ValueError, match="markers"):
        between(text, "other", "python -m benchmarks.bones", "new")
