"""A pose of a drawn limb over the server: what it answers and writes, what discards it, what is wrong."""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from tests.anatomy.two_bones import TWO_MUSCLES, elbow
from tests.cli.test_muscle_curves import request, served_in_a_thread, unpacked

from handpipe.cli.muscle_curves.server import CurveServer
from handpipe.cli.muscle_curves.session import CurveSession
from handpipe.core import InputError, RigidTransform
from handpipe.mesh.files import read_surface

SURFACES = elbow(6.0)
PATIENCE = 300.0  # s that a solve of some hundred tets may take on a busy machine
BENT = {"bone": "radius", "angle": 25}


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CurveSession]:
    """Curves of which tets have been made."""
    path = tmp_path_factory.mktemp("pose") / "arm.yaml"
    path.write_text(TWO_MUSCLES, encoding="utf-8")
    made = CurveSession(path, *SURFACES, 6.0)
    made.make_tets()
    yield made
    made.back_to_rest()


def start(session: CurveSession, **asked: object) -> str:
    return session.start_pose(json.dumps(BENT | asked).encode())


def ended(session: CurveSession) -> dict[str, Any]:
    """What is said of a solve after it has ended."""
    last = time.monotonic() + PATIENCE
    while (told := session.pose_state())["state"] == "running":
        assert time.monotonic() < last
        time.sleep(0.05)
    return told


def test_a_pose_is_solved_shown_and_written(session: CurveSession) -> None:
    assert "in 3 steps" in start(session)
    told = ended(session)
    assert (told["state"], told["step"], told["steps"]) == ("done", 3, 3)
    assert told["degrees"] == pytest.approx(25) and 0 <= told["residual"] < 1e-2
    _, arrays = unpacked(session.posed())
    joint = session.joints()["radius"]
    rest = SURFACES[1]["radius"].vertices
    moved = arrays["bone/radius/vertices"].reshape(-1, 3).astype(float)
    motion = RigidTransform.fit(rest, moved)
    np.testing.assert_allclose(motion(rest), moved, atol=1e-4)  # sent with seven digits
    assert np.degrees(np.linalg.norm(motion.rotation_vector())) == pytest.approx(25, abs=1e-3)
    np.testing.assert_allclose(motion(np.array([joint["centre"]])), [joint["centre"]], atol=0.1)
    folder = session.target.with_name("arm-pose-radius-bend-25")
    assert str(folder) in told["said"]
    written = sorted(str(p.relative_to(folder)) for p in folder.rglob("*.ply"))
    assert written == [
        "bone/humerus.ply",
        "bone/radius.ply",
        "muscle/extensor.ply",
        "muscle/flexor.ply",
        "skin.ply",
    ]
    skin = read_surface(folder / "skin.ply", closed=True)
    assert skin.volume() == pytest.approx(SURFACES[0].volume(), rel=0.01)
    far = SURFACES[0].vertices[:, 0] > 25  # where the skin follows the bone
    assert np.abs(skin.vertices[far] - motion(SURFACES[0].vertices[far])).mean() < 2.0
    figures = json.loads((folder / "pose.json").read_text(encoding="utf-8"))
    assert figures["angle_deg"] == pytest.approx(25) and figures["moving"] == ["radius"]


def test_a_muscle_contracts_in_a_folder_of_its_own(session: CurveSession) -> None:
    start(session, angle=0, muscle="flexor", shortening=10)
    assert ended(session)["state"] == "done"
    folder = session.target.with_name("arm-pose-radius-bend-0-flexor-10")
    posed = read_surface(folder / "muscle/flexor.ply", closed=True)
    assert session.tissue is not None
    rest = session.tissue.surface("flexor")
    assert posed.volume() == pytest.approx(rest.volume(), rel=0.02)
    assert np.abs(posed.vertices - rest.vertices).max() > 0.05


def test_a_stopped_or_edited_pose_is_discarded(session: CurveSession) -> None:
    start(session, angle=60)
    session.back_to_rest()
    assert session.pose_state() == {"state": "rest"}
    with pytest.raises(InputError, match="has not been simulated"):
        session.posed()
    assert not session.target.with_name("arm-pose-radius-bend-60").exists()
    content = yaml.safe_load(TWO_MUSCLES)
    start(session, angle=5)
    assert ended(session)["state"] == "done"
    session.edit(json.dumps(content).encode())  # the same curves
    assert session.pose_state()["state"] == "done"
    session.edit(json.dumps(content | {"fat": 0.35}).encode())
    assert session.pose_state() == {"state": "rest"}
    with pytest.raises(InputError, match="no tets of these curves.*Press Make tets"):
        start(session)
    session.edit(json.dumps(content).encode())  # undone: the tets are of these curves again
    start(session, angle=5)
    session.back_to_rest()


def test_a_solve_that_dies_is_said(session: CurveSession) -> None:
    start(session, angle=90)
    run = session._run
    assert run is not None
    run._process.kill()
    told = ended(session)
    assert told["state"] == "failed" and "ended without a result" in told["said"]
    with pytest.raises(InputError, match="has not been simulated"):
        session.posed()


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"bone": "ulna"}, "pose.bone: 'ulna' is unknown. Choose one of radius"),
        ({"bone": "humerus"}, "pose.bone: 'humerus' is unknown"),
        ({"angle": 121}, "pose.angle: 121 is no number from -120 to 120"),
        ({"angle": float("nan")}, "pose.angle: nan is no number"),
        ({"angle": None}, "pose.angle: None is no number"),
        ({"angle": "30"}, "pose.angle: 30 is no number"),
        ({"angle": True}, "pose.angle: True is no number"),
        ({"axis": "roll"}, "pose.axis: 'roll' is unknown"),
        ({"centre": [1, 2]}, "pose.centre: "),
        ({"centre": [1, 2, None]}, "pose.centre: "),
        ({"moving": ["humerus"]}, "humerus carries radius, and moves with it"),
        ({"moving": ["ulna"]}, "pose.moving: 'ulna' is unknown"),
        ({"moving": 3}, "pose.moving: is no list"),
        ({"muscle": "soleus", "shortening": 10}, "pose.muscle: 'soleus' is unknown"),
        ({"shortening": 10}, "pose.muscle: is not chosen"),
        ({"muscle": "flexor", "shortening": 41}, "pose.shortening: 41 is no number from 0 to 40"),
    ],
)
def test_what_is_wrong_is_one_message(session: CurveSession, asked: dict[str, object], said: str) -> None:
    with pytest.raises(InputError) as error:
        start(session, **asked)
    assert said in str(error.value) and "\n" not in str(error.value)
    assert session.pose_state()["state"] != "running"


def test_a_pose_needs_tets_and_an_object(tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text(TWO_MUSCLES, encoding="utf-8")
    fresh = CurveSession(path, *SURFACES, 12.0)
    with pytest.raises(InputError, match="no tets of these curves"):
        start(fresh)
    fresh.make_tets()
    for content, said in ((b"[]", "is no object"), (b"{", "is no JSON")):
        with pytest.raises(InputError, match=said):
            fresh.start_pose(content)


def test_the_server_answers_while_it_solves(session: CurveSession) -> None:
    with served_in_a_thread(CurveServer(session)) as server:
        assert json.loads(request(server, "joints.json"))["radius"]["parent"] == "humerus"
        said = json.loads(request(server, "pose", json.dumps(BENT | {"angle": 30}).encode()))["said"]
        assert said.startswith("Simulating")
        assert json.loads(request(server, "pose.json"))["state"] == "running"
        assert unpacked(request(server, "state"))[0]["faults"] == []
        ended(session)
        assert "skin/vertices" in unpacked(request(server, "posed"))[1]
        assert json.loads(request(server, "rest", b""))["said"] == "At rest"
        assert json.loads(request(server, "pose.json")) == {"state": "rest"}
        request(server, "pose", json.dumps(BENT | {"angle": 90}).encode())
    assert session.pose_state() == {"state": "rest"}  # closing the server ends the solve
