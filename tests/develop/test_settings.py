"""Settings are read from the source as they are written; each of the package has its unit, and one place."""

import math
from collections import defaultdict
from importlib import import_module
from pathlib import Path

import pytest

from handpipe.develop.settings import PURE, Setting, of_package, page, settings

SETTINGS = of_package()
CONSTANTS = [setting for found in SETTINGS.values() for setting in found if "." not in setting.name]


def written(text: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[Setting]:
    """Settings of a module with this text."""
    monkeypatch.setattr("handpipe.develop.settings.SOURCE", folder)
    (folder / "module.py").write_text(text, encoding="utf-8")
    return settings(folder / "module.py")


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("REACH = 2.0  # mm around a bone", ("REACH", "2.0", "mm", "around a bone")),
        ("TURN = np.radians(3.0)  # of a joint", ("TURN", "radians(3.0)", "rad", "of a joint")),
        ("SHARE = 0.5  # of a volume", ("SHARE", "0.5", PURE, "of a volume")),
        ("LEAST, MOST = 1, 2.5  # 1 and mm: an end", ("LEAST, MOST", "1, 2.5", "1 and mm", "an end")),
        ("# mm^2, of skin\n# that counts\nAREA = 30.0", ("AREA", "30.0", "mm^2", "of skin that counts")),
        ("FAT = Material(3.0, 0.45)  # kPa", ("FAT", "Material(3.0, 0.45)", "kPa", "")),
        ("TAMER = 2  # times slower", ("TAMER", "2", PURE, "times slower")),
    ],
)
def test_a_setting_has_its_value_unit_and_meaning(
    line: str, expected: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert written(line, tmp_path, monkeypatch) == [Setting("module", *expected)]


@pytest.mark.parametrize("line", ["ROWS = np.array([0, 1])", "KINDS = {1: 2}", "NAME = 'a'", "reach = 1.0"])
def test_tables_and_other_names_are_no_settings(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert written(line, tmp_path, monkeypatch) == []


def test_a_field_is_described_by_its_docstring(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (
        'class FitSettings:\n    """Of a fit.\n\n    Parameters\n    ----------\n    reach : float\n'
        '        Distance in mm up to which\n        scans count.\n    """\n\n    reach: float = 6.0\n'
    )
    found = written(text, tmp_path, monkeypatch)
    meaning = "Distance in mm up to which scans count."
    assert found == [Setting("module", "FitSettings.reach", "6.0", "mm", meaning)]


def test_every_setting_has_a_comment_with_its_unit_or_its_meaning() -> None:
    bare = [
        f"{s.module}: {s.name} = {s.value}"
        for found in SETTINGS.values()
        for s in found
        if s.unit == PURE and not s.meaning
    ]
    assert bare == [], "begin the comment with the unit; a pure number needs its meaning"


def test_no_setting_stands_twice() -> None:
    """Generators state what they need anew, so that a mistake of the pipeline shows."""
    places = defaultdict(list)
    for s in CONSTANTS:
        if not s.module.startswith("synthetic.") and s.meaning:
            places[s.name, s.value, s.unit, s.meaning].append(s.module)
    assert [(key[0], modules) for key, modules in places.items() if len(modules) > 1] == []


@pytest.mark.parametrize(
    ("module", "name", "value"),
    [("fem.minimisation.newton", "ARMIJO", 1e-4), ("skeleton.joints.limits", "MARGIN", math.radians(3.0))],
)
def test_the_page_has_the_numbers_of_the_code(module: str, name: str, value: float) -> None:
    assert getattr(import_module(f"handpipe.{module}"), name) == pytest.approx(value)
    section = page().split(f"\n### {module}\n")[1].split("\n### ")[0]
    row = next(line for line in section.splitlines() if line.startswith(f"| `{name}` |"))
    assert eval(row.split("|")[2].strip(" `"), {"radians": math.radians}) == pytest.approx(value)


def test_the_page_has_one_row_a_setting() -> None:
    rows = [line for line in page().splitlines() if line.startswith("| `")]
    assert len(rows) == sum(map(len, SETTINGS.values())) > 900
    assert all(len(row.replace(r"\|", "").split("|")) == 6 for row in rows)
