"""The chain on one finger under effects of images: judging, rows that are kept, and two coarse rows."""

from dataclasses import replace
from pathlib import Path

import pytest
from benchmarks.images.chain import document, rows
from benchmarks.images.chain.rows import Case, Row
from benchmarks.images.chain.stages import Word
from benchmarks.images.chain.verdicts import Error
from benchmarks.images.subject import Setting

BONES = ("proximal2", "middle2")
RIGHT = Row(
    "noise",
    "usual",
    0.8,
    [Error(b, "neutral", "Dice", 0.97, 0.93) for b in BONES]
    + [Error("flexor2", "curl", "centreline", 0.1, 0.5)],
    [],
    {"segment_pose": 1.0},
)


def changed(row: Row, error: Error, *said: Word) -> Row:
    return replace(row, errors=[*row.errors, error], said=[*said])


def test_a_wrong_organ_is_silent_unless_it_is_named() -> None:
    wrong = Error("flexor2", "neutral", "centreline", 0.7, 0.5)
    assert not RIGHT.wrong
    assert changed(RIGHT, wrong).silent == [wrong]
    of_another = Word("register_bones", [*BONES], "middle2: doubted")
    assert changed(RIGHT, wrong, of_another).silent == [wrong]
    assert changed(RIGHT, wrong, of_another).alarms == ["middle2"]
    own = Word("extract_tendon", ["flexor2"], "its sections hardly show")
    assert changed(RIGHT, wrong, own).silent == []


def test_a_warning_without_a_name_is_about_no_bone_but_an_error_is_about_all() -> None:
    joint = Word("fit_rig", [*BONES], "joint MP2: it turns too little")
    assert joint.about() == set()
    assert replace(joint, ended=True).about() == set(BONES)


def test_a_turn_is_stated_where_the_registration_expects_it() -> None:
    turn = Error("middle2", "curl", "turn", 2.0, 1.0, 0.7)
    row = changed(RIGHT, turn)
    assert row.wrong == [turn] and row.stated == [turn] and not row.silent
    assert changed(RIGHT, replace(turn, stated=0.6)).silent


def test_nothing_is_silent_where_the_neutral_pose_is_refused() -> None:
    missing = [replace(error, value=None) for error in RIGHT.errors]
    refusal = Word("merge_labels", [*BONES], "seeds: middle2: no dark shell closes it", True)
    row = replace(RIGHT, errors=missing, said=[refusal])
    assert len(row.wrong) == 3 and not row.silent
    assert row.refused == {"middle2"}
    assert replace(row, said=[]).silent
    assert rows.figures([RIGHT, row, replace(row, said=[])])["chain_effects_silent"] == (1, "1")


def test_each_effect_is_alone_at_both_strengths_and_all_are_together() -> None:
    found = [(case.effect, case.strength) for case in rows.cases()]
    assert len(set(found)) == len(found) == 2 * len(rows.EFFECTS) + 2
    assert ("all effects", "usual") in found
    assert {case.setting.spacing for case in rows.sweep()} == {0.5, 0.8, 1.0}


def test_rows_that_are_kept_are_not_measured_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def measure(case: Case) -> Row:
        asked.append(case.effect)
        return replace(RIGHT, effect=case.effect)

    monkeypatch.setattr(rows, "measure", measure)
    kept = tmp_path / "rows.json"
    first, second = (Case(name, "usual", Setting(spacing=0.8)) for name in ("noise", "coil"))
    [*rows.measured([first], kept)]
    found = [*rows.measured([first, second], kept)]
    assert asked == ["noise", "coil"]
    assert found[0] == RIGHT


@pytest.mark.slow
def test_a_coarse_image_is_right_or_noticed_and_a_poor_one_is_refused() -> None:
    ideal = rows.measure(Case("none", "none", Setting(spacing=0.9)))
    assert not ideal.silent and not ideal.refused
    organs = {e.organ for e in ideal.errors if e.value is not None}
    assert {"proximal2", "flexor2", "lumbrical1", "skin"} <= organs
    lines = ideal.worst("centreline")
    assert lines is not None and lines < 0.5
    poor = rows.measure(Case("all effects", "usual", Setting(others="usual", spacing=1.2)))
    assert poor.refused and poor.wrong and not poor.silent
    text = document.chain_table([ideal, poor], "abc")
    assert "refused for" in text and "in 0 a wrong" in text.splitlines()[0]
