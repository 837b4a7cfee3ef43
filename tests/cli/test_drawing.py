"""The page for strokes: its server gives and takes voxels of the volume, and writes one file only."""

import json
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import nibabel
import numpy as np
import pytest
import SimpleITK
import yaml

from handpipe.cli import main
from handpipe.cli.drawing import DrawingServer, canvas, labels_to_look_at, strokes_to_draw
from handpipe.core import InputError, paths
from handpipe.core.configuration import Dataset
from handpipe.imaging.volumes import pose_volume, read_labels, write_labels

SOURCE = Path("config/datasets/mine.yaml")
STORED = (7, 5, 6)  # voxels as the file stores them: axes superior, left, anterior
SPACING = (1.5, 0.8, 1.1)


def tilted() -> np.ndarray:
    """Affine of a volume with axes S, L, A, turned by 20 degrees about S."""
    turn = np.radians(20)
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    axes = np.array([[0, -1, 0], [0, 0, 1], [1, 0, 0]])
    affine = np.eye(4)
    affine[:3, :3] = rotation @ axes @ np.diag(SPACING)
    affine[:3, 3] = (12.0, -30.0, 5.0)
    return affine


def dataset(folder: Path, seeds: str | None = "seeds.nii.gz", **further: Any) -> Dataset:
    """A subject of two bones in two poses, whose volume is tilted and stored in an odd order of axes."""
    values = np.arange(np.prod(STORED), dtype=np.float32).reshape(STORED)
    nibabel.save(nibabel.Nifti1Image(values, tilted()), folder / "volume.nii.gz")
    pose: dict[str, Any] = {"volume": "volume.nii.gz"}
    neutral = pose | {"role": "neutral", "seeds": seeds}
    fist = pose | {"role": "example", "scribbles": {"distal": "distal.nii.gz"}}
    joint = {"parent": "middle", "child": "distal", "angles": [], "limits_deg": [], "axis_hints": []}
    content = {
        "name": "mine",
        "root": str(folder),
        "poses": {"neutral": neutral, "fist": fist},
        "bones": {"middle": {"label": 3}, "distal": {"label": 7}},
        "other_labels": {"sesamoid": 9},
        "joints": {"DIP": joint},
    }
    return Dataset.model_validate(content | further)


@pytest.fixture
def served(tmp_path: Path) -> Iterator[DrawingServer]:
    yield from running(strokes_to_draw(SOURCE, dataset(tmp_path), "neutral"))


def running(drawn_on: canvas.Canvas) -> Iterator[DrawingServer]:
    with DrawingServer(drawn_on) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def get(server: DrawingServer, name: str) -> bytes:
    with urlopen(server.address + name, timeout=10) as response:
        found: bytes = response.read()
    return found


def post(url: str, body: bytes = b"", **headers: str) -> str:
    with urlopen(Request(url, data=body, headers=headers, method="POST"), timeout=10) as response:
        return str(json.loads(response.read())["said"])


def refused(url: str, body: bytes | None = None, **headers: str) -> tuple[int, str]:
    """Status and text of a request that is refused."""
    with pytest.raises(HTTPError) as error:
        urlopen(Request(url, data=body, headers=headers), timeout=10)
    with error.value as answer:
        return answer.code, json.loads(answer.read())["said"]


def drawing(server: DrawingServer) -> np.ndarray:
    """The page's drawing: one byte a voxel of the image that it shows."""
    shape = json.loads(get(server, "settings.json"))["shape"]
    return np.frombuffer(get(server, "drawing"), np.uint8).reshape(shape, order="F").copy()


def shown(server: DrawingServer) -> np.ndarray:
    """Values of the image that the page shows, whose axes the viewer does not exchange."""
    image = nibabel.Nifti1Image.from_bytes(get(server, "volume.nii"))
    assert nibabel.aff2axcodes(image.affine) == ("R", "A", "S")
    np.testing.assert_allclose(image.affine[:3, :3], np.diag(np.diag(image.affine[:3, :3])))
    return np.asarray(image.dataobj)


@pytest.mark.parametrize("name", ["seeds.nii.gz", "seeds.seg.nrrd"])
def test_strokes_come_into_the_voxels_on_which_they_are_drawn(tmp_path: Path, name: str) -> None:
    """Voxels are told by their intensities, which differ, and by their places in the world."""
    subject = dataset(tmp_path, name)
    picked = {(2, 1, 3): 3, (6, 4, 5): 7, (0, 0, 0): 9, (5, 2, 0): 255}  # as the file stores them
    for server in running(strokes_to_draw(SOURCE, subject, "neutral")):
        values, strokes = shown(server), drawing(server)
        for place, label in picked.items():
            strokes[values == np.ravel_multi_index(place, STORED)] = label
        said = post(server.address + "save", strokes.tobytes(order="F"))
        assert said.startswith(f"saved 4 voxels to {tmp_path / name}")
    volume = pose_volume(subject, "neutral")
    read = read_labels(tmp_path / name, volume, subject.seed_labels)
    for place, label in picked.items():
        at = volume.to_index((tilted() @ [*place, 1.0])[None, :3])
        assert read[tuple(np.rint(at[0]).astype(int))] == label
    assert np.count_nonzero(read) == len(picked)
    image = SimpleITK.ReadImage(str(tmp_path / name))  # a reader of its own
    world = (tilted() @ [2, 1, 3, 1.0])[:3] * [-1, -1, 1]
    assert image[image.TransformPhysicalPointToIndex(world.tolist())] == 3


def test_earlier_strokes_are_shown_and_kept_once(tmp_path: Path) -> None:
    subject = dataset(tmp_path)
    volume = pose_volume(subject, "neutral")
    before = np.zeros(volume.shape, np.uint8)
    before[1, 2, 3] = 7
    write_labels(tmp_path / "seeds.nii.gz", before, volume.affine)
    for server in running(strokes_to_draw(SOURCE, subject, "neutral")):
        strokes = drawing(server)
        np.testing.assert_array_equal(strokes, before)
        strokes[0, 0, 0] = 255
        said = post(server.address + "save", strokes.tobytes(order="F"))
        strokes[0, 0, 1] = 255
        post(server.address + "save", strokes.tobytes(order="F"))
    [kept] = tmp_path.glob("seeds.before-*.nii.gz")
    assert said.endswith(f"the earlier file is {kept.name}")
    np.testing.assert_array_equal(read_labels(kept, volume), before)
    np.testing.assert_array_equal(read_labels(tmp_path / "seeds.nii.gz", volume), strokes)


def test_proposed_seeds_are_shown_where_nothing_is_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    subject = dataset(tmp_path)
    volume = pose_volume(subject, "neutral")
    proposed = np.full(volume.shape, 255, np.uint8)
    write_labels(paths.at(paths.SEEDS, subject="mine", pose="neutral"), proposed, volume.affine)
    assert (strokes_to_draw(SOURCE, subject, "neutral").drawing == 255).all()
    assert not strokes_to_draw(SOURCE, subject, "fist", "distal").drawing.any()


def test_only_who_has_the_address_is_answered(served: DrawingServer) -> None:
    blank = bytes(served.canvas.drawing.size)
    host = f"http://127.0.0.1:{served.server_port}"
    for url in (
        f"{host}/",
        f"{host}/save",
        f"{host}/{'x' * 32}/save",
        f"{host}/{served.secret[:-1]}/drawing",
    ):
        assert refused(url, blank if url.endswith("save") else None)[0] == 403
    assert refused(served.address + "save", blank, Host="elsewhere.example")[0] == 403
    assert refused(served.address + "settings.json", Host=f"elsewhere.example:{served.server_port}")[0] == 403
    assert not list(served.canvas.target.parent.glob("seeds*"))


@pytest.mark.parametrize("name", ["../volume.nii.gz", "static/page.html", "page.html", "%2e%2e/page.js"])
def test_no_other_file_is_given(served: DrawingServer, name: str) -> None:
    assert refused(served.address + name)[0] == 404
    assert refused(served.address + name, b"x")[0] == 404


def test_drawings_that_are_none_are_refused_and_nothing_is_written(served: DrawingServer) -> None:
    url, size = served.address + "save", served.canvas.drawing.size
    status, said = refused(url, bytes(size - 1))
    assert status == 400 and f"the volume has {size} voxels" in said
    assert refused(url, bytes(size + 1))[0] == 400
    assert refused(url, bytes(size), **{"Content-Length": "1" + "0" * 30})[0] == 400
    status, said = refused(url, bytes([4]) + bytes(size - 1))
    assert status == 400 and "has the label 4" in said
    assert not list(served.canvas.target.parent.glob("seeds*"))


def test_the_page_loads_nothing_from_elsewhere(served: DrawingServer) -> None:
    page = get(served, "").decode()
    assert "http" not in page
    with urlopen(served.address, timeout=10) as response:
        assert "default-src 'self'" in response.headers["Content-Security-Policy"]
    with urlopen(served.address + "viewer.js", timeout=10) as response:
        assert response.headers["Content-Encoding"] == "gzip"
        assert len(response.read()) < 1_000_000
    assert "Redistributions in binary form" in get(served, "licence.txt").decode()


def test_the_page_ends_the_server(tmp_path: Path) -> None:
    with DrawingServer(strokes_to_draw(SOURCE, dataset(tmp_path), "neutral")) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        assert post(server.address + "stop") == "ended"
        thread.join(10)
        assert not thread.is_alive()


def test_looking_saves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    subject = dataset(tmp_path)
    volume = pose_volume(subject, "fist")
    labels = np.zeros(volume.shape, np.uint8)
    labels[2:4, 1:3, 1:3] = 3
    write_labels(paths.at(paths.LABELS, subject="mine", pose="fist"), labels, volume.affine, subject.labels)
    for server in running(labels_to_look_at(SOURCE, subject, "fist")):
        np.testing.assert_array_equal(drawing(server), labels)
        settings = json.loads(get(server, "settings.json"))
        assert settings["file"] is None and "background" not in settings["pens"]
        assert refused(server.address + "save", bytes(labels.size))[0] == 400


@pytest.mark.parametrize(
    ("arguments", "further", "said"),
    [
        (("hook", None), {}, "poses.hook: is no pose. The poses are neutral, fist"),
        (("fist", None), {}, "poses.fist.seeds: names no file for the strokes"),
        (("fist", "middle"), {}, "poses.fist.scribbles.middle: names no file for the strokes"),
        (("neutral", None), {"seeds": "seeds.ply"}, "seeds.ply is none of .nii, .nii.gz, .seg.nrrd"),
    ],
)
def test_what_cannot_be_drawn_is_named(
    tmp_path: Path, arguments: tuple[str, str | None], further: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError) as error:
        strokes_to_draw(SOURCE, dataset(tmp_path, **further), *arguments)
    assert said in str(error.value)


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the subject's dataset file, as the command wants it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "Snakefile").touch()
    content = dataset(tmp_path).model_dump(mode="json", exclude_defaults=True)
    (tmp_path / SOURCE).parent.mkdir(parents=True)
    (tmp_path / SOURCE).write_text(yaml.safe_dump(content), encoding="utf-8")
    return tmp_path


def test_the_command_serves_what_is_asked_for(
    project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = []
    monkeypatch.setattr("handpipe.cli.drawing.serve", lambda *given: asked.append(given))
    assert main(["draw", "mine", "fist", "--bone", "distal", "--no-browser"]) == 0
    assert main(["draw", "mine", "neutral", "--look"]) == 0
    (scribbles, opened), (look, looked_at) = asked
    assert scribbles.target == project / "distal.nii.gz" and not opened
    assert look.target is None and looked_at
    assert main(["draw", "mine", "fist"]) == 1
    assert "poses.fist.seeds: names no file" in capsys.readouterr().err
    assert main(["draw", "--help"]) == 0
    assert "--look" in capsys.readouterr().out
    shutil.rmtree(project / "config")
    assert main(["draw", "mine", "fist"]) == 1
