"""Curves of muscles edited over the server: what an edit answers, what is saved, which tets are made."""

import json
import re
import shlex
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest
import yaml
from tests.anatomy.arm import THREE_MUSCLES, arm

from handpipe.anatomy.editing import content_of
from handpipe.anatomy.templates import TissueMesh, load_curves
from handpipe.cli import main
from handpipe.cli.muscle_curves import CurveServer, CurveSession, open_session, write_example
from handpipe.core import InputError
from handpipe.mesh.files import read_surface, write_surface
from handpipe.mesh.surfaces import Distance

SURFACES = arm(4.0)


@pytest.fixture(scope="module")
def surfaces(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("arm")
    (folder / "bones").mkdir()
    write_surface(folder / "skin.ply", SURFACES[0])
    write_surface(folder / "bones" / "radius.stl", SURFACES[1]["radius"])
    return folder


@pytest.fixture(scope="module")
def opened(surfaces: Path) -> CurveSession:
    path = surfaces / "arm.yaml"
    path.write_text(THREE_MUSCLES, encoding="utf-8")
    return open_session(path, surfaces / "skin.ply", [surfaces / "bones"], 4.0)


@pytest.fixture
def served(opened: CurveSession, tmp_path: Path) -> Iterator[CurveServer]:
    """The server; the file is a new one for each test."""
    opened.target, opened.kept = tmp_path / "arm.yaml", None
    opened.target.write_text(THREE_MUSCLES, encoding="utf-8")
    opened.edit(json.dumps(content()).encode())
    with served_in_a_thread(CurveServer(opened)) as server:
        yield server


@contextmanager
def served_in_a_thread(server: CurveServer) -> Iterator[CurveServer]:
    """A server that answers until it is closed."""
    with server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def content() -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load(THREE_MUSCLES)
    return found


def flexor(edited: dict[str, Any]) -> list[dict[str, Any]]:
    points: list[dict[str, Any]] = edited["muscles"]["flexor"]["curves"][0]["points"]
    return points


def unpacked(message: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    length = int(np.frombuffer(message, "<u4", 1)[0])
    header, rest = json.loads(message[4 : 4 + length]), message[4 + length :]
    arrays = {
        name: np.frombuffer(rest, f"<{kind}", count, offset)
        for name, (kind, offset, count) in header["arrays"].items()
    }
    return header, arrays


def request(server: CurveServer, name: str, body: bytes | None = None) -> bytes:
    url = name if name.startswith("http") else server.address + name
    with urlopen(Request(url, data=body), timeout=60) as response:
        found: bytes = response.read()
    return found


def edit(server: CurveServer, edited: dict[str, Any]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    return unpacked(request(server, "edit", json.dumps(edited).encode()))


def refused(server: CurveServer, name: str, body: bytes | None = None) -> tuple[int, str]:
    with pytest.raises(HTTPError) as error:
        request(server, name, body)
    with error.value as answer:
        return answer.code, json.loads(answer.read())["said"]


def test_an_edit_answers_with_places_lines_and_surfaces(served: CurveServer) -> None:
    edited = content()
    flexor(edited)[1] = {"at": [0, 0, -13.0], "tissue": 1.5}
    header, arrays = edit(served, edited)
    assert header["content"] == edited
    assert header["faults"] == [] and header["seconds"] > 0
    assert header["places"]["flexor"]["curves"][0][1] == [0, 0, -13]
    line = arrays["line/flexor/0"].reshape(-1, 3)
    assert np.linalg.norm(line - [0, 0, -13], axis=1).min() < 0.6
    vertices = arrays["muscle/flexor/vertices"].reshape(-1, 3)
    triangles = arrays["muscle/flexor/triangles"].reshape(-1, 3)
    assert triangles.max() == len(vertices) - 1
    assert SURFACES[0].contains(vertices.astype(float)).all()
    statics = unpacked(request(served, "surfaces"))[1]
    np.testing.assert_allclose(statics["skin/vertices"].reshape(-1, 3), SURFACES[0].vertices, atol=1e-3)
    assert "bone/radius/triangles" in statics


def test_a_point_is_dropped_on_a_bone(served: CurveServer) -> None:
    edited = content()
    flexor(edited)[0] = {"drop": [-20, 1, -9], "bone": "radius", "tissue": 2}
    flexor(edited)[2] = {"drop": [25, 0, -9]}
    header, _ = edit(served, edited)
    first, _, last = flexor(header["content"])
    assert first["bone"] == last["bone"] == "radius" and first["tissue"] == 2 and "drop" not in first
    place = np.array(header["places"]["flexor"]["curves"][0][0])
    wanted = Distance(SURFACES[1]["radius"]).closest(np.array([[-20.0, 1, -9]]))[2][0]
    np.testing.assert_allclose(place, wanted, atol=0.02)
    again, _ = edit(served, header["content"])
    assert again["content"] == header["content"]  # places stay where they are


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (b"{", "is no JSON"),
        (b"[]", "Input should be"),
        (json.dumps({"muscles": {"a": {"curves": []}}}).encode(), "muscles.a.curves"),
        (json.dumps({"muscles": {"a": {"curves": [{"points": [{"drop": [1]}]}]}}}).encode(), "is no point"),
    ],
)
def test_a_wrong_edit_is_one_sentence_and_changes_nothing(
    served: CurveServer, body: bytes, said: str
) -> None:
    before = request(served, "state")
    status, text = refused(served, "edit", body)
    assert status == 400 and said in text
    assert request(served, "state") == before


def test_points_without_a_place_are_refused_and_the_next_edit_is_right(served: CurveServer) -> None:
    edited = content()
    flexor(edited)[0]["bone"] = "ulna"
    assert "'ulna' is no bone" in refused(served, "edit", json.dumps(edited).encode())[1]
    assert edit(served, content())[0]["content"] == content()


def test_only_who_has_the_address_is_answered(served: CurveServer) -> None:
    host = f"http://127.0.0.1:{served.server_port}"
    for path in ("/", "/save", f"/{'x' * 32}/save", f"/{served.secret[:-1]}/state"):
        assert refused(served, host + path)[0] == 403
    for name in ("../pyproject.toml", "static/page.html", "page.html", "session.py"):
        assert refused(served, name)[0] == 404
    assert refused(served, "edit", b" " * (2**22 + 1))[0] == 400
    page = request(served, "").decode()
    assert "IMPORT_MAP" not in page and "NONCE" not in page and "https://" not in page.split("</script>")[1]


def test_a_saved_file_reads_as_the_same_curves(served: CurveServer) -> None:
    target = served.session.target
    edited = content()
    flexor(edited).insert(1, {"at": [-10.125, 0.5, -11.0], "spread": [0.5, 2]})
    edited["muscles"]["flexor"]["curves"][0]["normal"] = [0, 1, 0]
    del edited["muscles"]["abductor"]
    edit(served, edited)
    assert target.read_text(encoding="utf-8") == THREE_MUSCLES  # nothing before it is saved
    said = json.loads(request(served, "save", b""))["said"]
    assert said.startswith(f"saved 2 muscles to {target}")
    assert load_curves(target) == type(load_curves(target)).model_validate(edited)
    assert content_of(load_curves(target)) == edited
    request(served, "save", b"")
    [kept] = target.parent.glob("arm.before-*.yaml")
    assert said.endswith(kept.name) and kept.read_text(encoding="utf-8") == THREE_MUSCLES
    assert sorted(target.parent.iterdir()) == sorted([target, kept])
    edit(served, {"muscles": {}})
    assert "Draw a muscle first" in refused(served, "save", b"")[1]


def test_tets_are_made_where_nothing_is_wrong(served: CurveServer) -> None:
    edited = content()
    flexor(edited)[1]["at"] = [0, 0, -24]
    assert "lie outside the skin" in edit(served, edited)[0]["faults"][0]
    status, said = refused(served, "tets", b"")
    assert status == 400 and "muscles.flexor.curves.0" in said and "Move its points into the skin" in said
    assert not served.session.target.with_suffix(".h5").exists()
    edit(served, content())
    said = json.loads(request(served, "tets", b""))["said"]
    made = TissueMesh.load(served.session.target.with_suffix(".h5"))
    assert made.names == ("fat", "flexor", "extensor", "abductor")
    assert f"{len(made.labels)} tets" in said and "flexor" in said
    lines = unpacked(request(served, "fibres"))[1]["lines"].reshape(-1, 2, 3).astype(float)
    assert 100 < len(lines) <= 1500
    along = np.abs((lines[:, 1] - lines[:, 0])[:, 0]) / np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
    assert np.median(along) > 0.9  # the arm's muscles run along x
    assert SURFACES[0].contains(lines.mean(axis=1)).all()


def curves(*arguments: object) -> int:
    return main(["curves", *map(str, arguments)])


def test_check_names_each_fault(surfaces: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ("--skin", surfaces / "skin.ply", "--bones", surfaces / "bones" / "radius.stl", "--check")
    path = tmp_path / "arm.yaml"
    path.write_text(THREE_MUSCLES, encoding="utf-8")
    assert curves(path, *given, "--edge-length", 5) == 0
    assert "nothing is wrong" in capsys.readouterr().out
    edited = content()
    flexor(edited)[0], flexor(edited)[2] = {"at": [-28, 0, -13]}, {"at": [28, 0, -13]}
    edited["muscles"]["abductor"]["curves"][0]["points"][1]["at"] = [5, -30, 6]
    path.write_text(yaml.safe_dump(edited, sort_keys=False), encoding="utf-8")
    assert curves(path, *given, "--edge-length", 5) == 1
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2
    assert "muscles.flexor: is attached to no bone: its origin lies" in said[0]
    assert "muscles.abductor.curves.0:" in said[1] and "outside the skin" in said[1]


def test_wrong_arguments_are_one_line(
    surfaces: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    skin, bones = surfaces / "skin.ply", surfaces / "bones"
    (tmp_path / "2nd.ply").write_bytes(skin.read_bytes())
    (tmp_path / "empty").mkdir()
    cases = {
        "are needed": (tmp_path / "a.yaml", "--skin", skin),
        "is no YAML file": (tmp_path / "a.txt", "--skin", skin, "--bones", bones),
        "does not exist": (tmp_path / "a.yaml", "--skin", tmp_path / "no.ply", "--bones", bones),
        "has no surface": (tmp_path / "a.yaml", "--skin", skin, "--bones", tmp_path / "empty"),
        "is no name of a bone": (tmp_path / "a.yaml", "--skin", skin, "--bones", tmp_path / "2nd.ply"),
        "stands twice": (tmp_path / "a.yaml", "--skin", skin, "--bones", bones, "--bones", bones),
        "is not empty": ("--example", surfaces),
    }
    for said, arguments in cases.items():
        assert curves(*arguments) == 1
        [line] = capsys.readouterr().err.splitlines()
        assert said in line


def test_the_example_has_no_fault(tmp_path: Path) -> None:
    written = write_example(tmp_path / "leg")
    assert all(path.is_file() for path in written)
    folder = tmp_path / "leg"
    session = open_session(folder / "leg.yaml", folder / "skin.ply", [folder / "bones"], 12.0)
    assert session.edited.faults == () and session.edited.warnings == ()
    assert set(session.edited.surfaces) == set(session.draft.muscles)
    bones = [read_surface(path, closed=True) for path in sorted((folder / "bones").iterdir())]
    assert all(session.skin.contains(bone.vertices).all() for bone in bones)


def test_there_need_be_no_file(surfaces: Path, tmp_path: Path) -> None:
    session = open_session(tmp_path / "new.yaml", surfaces / "skin.ply", [surfaces / "bones"], 5.0)
    assert unpacked(session.state())[0]["content"] == {}
    with pytest.raises(InputError, match="Draw a muscle first"):
        session.make_tets()
    (tmp_path / "turned.yaml").write_text("distal: [0, 0, -1]", encoding="utf-8")
    turned = open_session(tmp_path / "turned.yaml", surfaces / "skin.ply", [surfaces / "bones"], 5.0)
    assert turned.draft.distal == (0, 0, -1)
    session.edit(json.dumps({"muscles": {"flexor": content()["muscles"]["flexor"]}}).encode())
    session.save()
    assert list(load_curves(tmp_path / "new.yaml").muscles) == ["flexor"]


def test_the_command_serves_the_page_until_it_is_ended(surfaces: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "handpipe.cli", "curves", tmp_path / "new.yaml", "--no-browser"]
    given = ["--skin", surfaces / "skin.ply", "--bones", surfaces / "bones", "--edge-length", "6"]
    with subprocess.Popen([*command, *given], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert "muscles as curves" in process.stdout.readline()
        address = process.stdout.readline().strip()
        with urlopen(address, timeout=10) as response:
            assert "script-src 'self' data: 'nonce-" in response.headers["Content-Security-Policy"]
        with urlopen(Request(address + "stop", data=b""), timeout=10) as response:
            assert json.loads(response.read())["said"] == "ended"
        assert process.wait(timeout=20) == 0


HOW_TO = Path(__file__).parents[2] / "docs/how-to/muscle-curves.md"


def test_the_commands_of_the_how_to_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Those that open a page are checked only."""
    blocks = re.findall(r"^```\n(.*?)^```$", HOW_TO.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    lines = [shlex.split(line) for block in blocks for line in block.splitlines()]
    assert len(lines) == 4
    monkeypatch.chdir(tmp_path)  # no folder of the project is needed
    for program, *arguments in lines:
        assert program == "handpipe"
        opens = "--example" not in arguments
        assert main([*arguments, *(["--check", "--edge-length", "14"] if opens else [])]) == 0
        assert capsys.readouterr().out
