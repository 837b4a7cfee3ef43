"""The commands of docs/anatomy.md: files in, hands out; a wrong input ends with one line and no output."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from tests.anatomy.hand_templates import furnished
from tests.anatomy.test_photograph import clicked

from handpipe.anatomy.__main__ import main
from handpipe.anatomy.person import feature_points
from handpipe.anatomy.person.family import MEDIAN_MALE, lengths_of
from handpipe.anatomy.person.subject_template import SubjectTemplate

TEXT = (Path(__file__).parents[2] / "docs/anatomy.md").read_text(encoding="utf-8").split("## Commands")[1]
TEMPLATE = "results/phantom-hand/anatomy/subject.h5"


def documented(name: str) -> list[str]:
    """Arguments of a command in the document."""
    line = re.search(rf"^python -m handpipe.anatomy ({name} .*)$", TEXT, re.MULTILINE)
    return shlex.split(line[1])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that the document shows, in which the commands run."""
    monkeypatch.chdir(tmp_path)
    furnished().save(TEMPLATE)
    for text in re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL):
        (tmp_path / re.search(r"# (\w+\.yaml)", text)[1]).write_text(text, encoding="utf-8")
    return tmp_path


def test_a_template_of_no_hand_of_the_family_is_named(
    folder: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "family").mkdir()
    for name in ("removed.h5", "notes.txt"):
        (folder / "family" / name).write_text("", encoding="utf-8")
    monkeypatch.setattr("handpipe.anatomy.__main__.family", lambda template, hands, source: {})
    monkeypatch.setattr("handpipe.anatomy.__main__._print_lengths", lambda hands: None)
    assert main(documented("family")) == 0
    said = capsys.readouterr().err
    assert said == "handpipe: family holds removed.h5, too, of no hand in hands.yaml\n"
    (folder / "family" / "removed.h5").unlink()
    assert main(documented("family")) == 0
    assert capsys.readouterr().err == ""


def failure(arguments: list[str], capsys: pytest.CaptureFixture) -> str:
    """The one line with which a command fails."""
    assert main(arguments) == 1
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("handpipe: ")
    return line


def test_a_family_has_the_stated_sizes(folder: Path, capsys: pytest.CaptureFixture) -> None:
    assert main(documented("family")) == 0
    hands = {path.stem: SubjectTemplate.load(path) for path in (folder / "family").iterdir()}
    assert set(hands) == {"adult", "child", "narrow", "long_finger"}
    own = lengths_of(furnished())
    wanted = {
        "adult": MEDIAN_MALE,
        "child": {b: 0.6 * v for b, v in MEDIAN_MALE.items()},
        "narrow": own,
        "long_finger": MEDIAN_MALE | {"proximal3": 48, "middle3": 26},
    }
    for name, lengths in wanted.items():
        assert lengths_of(hands[name]) == pytest.approx(lengths, abs=0.1), name
    widths = [
        np.linalg.norm(t.bones["trapezoid"].centroid() - t.bones["hamate"].centroid())
        for t in (hands["narrow"], furnished())
    ]
    assert widths[0] / widths[1] == pytest.approx(0.9, abs=0.03)
    header, *rows = capsys.readouterr().out.splitlines()
    assert header.split() == ["mm", "template", "adult", "child", "narrow", "long_finger"]
    assert [row.split()[0] for row in rows] == list(own)


def test_a_photograph_of_the_template_gives_the_template_back(
    folder: Path, capsys: pytest.CaptureFixture
) -> None:
    """The document's clicks are the template's own points, rounded to a pixel of 0.13 mm."""
    assert main(documented("photograph")) == 0
    assert re.search(r"size +(0\.99\d|1\.00\d)", capsys.readouterr().out)
    own = furnished().feature_points
    found = feature_points.read(folder / "points.mrk.json")
    middle = np.mean([own[n] - p for n, p in found.items()], axis=0)
    for name, point in found.items():
        assert point + middle == pytest.approx(own[name], abs=0.15), name
    assert main(documented("warp")) == 0
    person = SubjectTemplate.load(folder / "person.h5")
    assert lengths_of(person) == pytest.approx(lengths_of(furnished()), rel=0.02)
    assert len(person.tendons) == len(furnished().tendons)


def test_a_photograph_of_a_smaller_hand_gives_a_smaller_hand(
    folder: Path, capsys: pytest.CaptureFixture
) -> None:
    smaller = {name: 0.7 * point for name, point in furnished().feature_points.items()}
    photo = clicked(smaller, furnished(), mirrored=True)
    (folder / "clicks.yaml").write_text(photo.model_dump_json(), encoding="utf-8")
    assert main(documented("photograph")) == 0
    printed = capsys.readouterr().out
    assert "0.700" in printed and "mirrored: " in printed
    assert main(documented("warp")) == 0
    person = SubjectTemplate.load(folder / "person.h5")
    volumes = {n: (b.volume(), furnished().bones[n].volume()) for n, b in person.bones.items()}
    for name, (volume, own) in volumes.items():
        assert volume / own == pytest.approx(0.7**3, rel=1e-4), name


def test_points_of_the_other_hand_need_the_mirrored_template(
    folder: Path, capsys: pytest.CaptureFixture
) -> None:
    left = furnished().mirrored()
    feature_points.write(folder / "points.mrk.json", left.feature_points)
    arguments = documented("warp")[:-1]
    assert "--mirror" in failure(arguments, capsys)
    assert not (folder / "person.h5").exists()
    assert main([*arguments, "--mirror"]) == 0
    person = SubjectTemplate.load(folder / "person.h5")
    assert person.side == "left"
    for name, bone in left.bones.items():
        assert person.bones[name].vertices == pytest.approx(bone.vertices, abs=0.2), name


@pytest.mark.parametrize(
    ("name", "file", "text", "said"),
    [
        ("family", "hands.yaml", "hands: {a: {size: -1}}", "hands.yaml: hands.a.size: "),
        ("family", "hands.yaml", "hands: {}", "hands.yaml: hands: "),
        (
            "family",
            "hands.yaml",
            "hands: {a: {}, b: {lengths: {capitate: 20}}}",
            "hands.yaml: hands.b.lengths: capitate: is no long bone",
        ),
        ("family", "hands.yaml", "hands: {a: {size: 9}}", "hands.yaml: hands.a.lengths: "),
        ("family", "hands.yaml", "hands: {../a: {}}", "hands.yaml: hands.../a"),
        ("photograph", "clicks.yaml", "points: {}", "clicks.yaml: "),
        ("warp", "points.mrk.json", "{}", "points.mrk.json: markups: "),
    ],
)
def test_a_wrong_file_is_named_and_nothing_is_written(
    folder: Path, capsys: pytest.CaptureFixture, name: str, file: str, text: str, said: str
) -> None:
    (folder / file).write_text(text, encoding="utf-8")
    before = sorted(folder.rglob("*"))
    assert said in failure(documented(name), capsys)
    assert sorted(folder.rglob("*")) == before


def test_a_missing_template_is_named(folder: Path, capsys: pytest.CaptureFixture) -> None:
    (folder / TEMPLATE).unlink()
    assert f"{TEMPLATE}: file: does not exist" in failure(documented("family"), capsys)
