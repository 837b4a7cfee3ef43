"""Edits of curves: surfaces against the tets of the conforming mesh, faults, files that read as they were."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from tests.anatomy.arm import THREE_MUSCLES, arm
from tests.anatomy.meshes import box

from handpipe.anatomy.editing import (
    CurveEditor,
    Draft,
    content_of,
    load_draft,
    place_on_bone,
    tendon_lines,
    write_curves,
)
from handpipe.anatomy.editing.envelope_surfaces import envelope_surfaces
from handpipe.anatomy.templates.curves import CurveFile, load_curves, locate
from handpipe.anatomy.templates.diffusion import Functions
from handpipe.anatomy.templates.domain import Domain
from handpipe.anatomy.templates.envelope import upper_envelope
from handpipe.anatomy.templates.hand import load_hand
from handpipe.core.errors import InputError
from handpipe.mesh.surfaces.distance import Distance

SKIN, BONES = arm(4.0)


@pytest.fixture(scope="module")
def domain() -> Domain:
    return Domain.between(SKIN, BONES, 4.0)


@pytest.fixture(scope="module")
def editor(domain: Domain) -> CurveEditor:
    return CurveEditor(domain, SKIN, BONES, source="arm.yaml")


def content() -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load(THREE_MUSCLES)
    return found


def test_the_surface_of_a_ball_has_its_radius_and_faces_outwards() -> None:
    mesh = box((14, 14, 14), (10.0, 10.0, 10.0))
    away = np.linalg.norm(mesh.vertices - [5.1, 4.9, 5.0], axis=1)
    values = np.column_stack([np.zeros(len(away)), 3.0 - away])
    surface = envelope_surfaces(mesh, Functions(("fat", "ball"), values))["ball"]
    assert surface.is_closed()
    radii = np.linalg.norm(surface.vertices - [5.1, 4.9, 5.0], axis=1)
    np.testing.assert_allclose(radii, 3.0, atol=0.07)  # h^2 / 8 r of linear functions
    np.testing.assert_allclose(surface.volume(), 4 / 3 * np.pi * 27, rtol=0.03)  # positive: outwards


def test_surfaces_lie_on_the_borders_of_the_conforming_envelope(editor: CurveEditor) -> None:
    edited = editor.edit(CurveFile.model_validate(content()))
    assert list(edited.surfaces) == ["flexor", "extensor", "abductor"]
    cut = upper_envelope(editor.domain.mesh, edited.functions.values)
    for name, surface in edited.surfaces.items():
        own = cut.mesh.part(cut.labels == edited.functions.names.index(name))[0].boundary()
        away = Distance(own).closest(surface.vertices)[0]
        assert np.quantile(away, 0.85) < 1e-9  # where two tissues meet
        assert away.max() < 2.0  # where three do: half an edge
    assert edited.faults == ()


def test_only_the_edited_muscle_is_placed_anew(editor: CurveEditor) -> None:
    before = editor.edit(CurveFile.model_validate(content()))
    moved = content()
    moved["muscles"]["flexor"]["curves"][0]["points"][1]["at"] = [0, 0, -11]
    after = editor.edit(CurveFile.model_validate(moved))
    assert after.muscles["extensor"] is before.muscles["extensor"]
    assert after.muscles["flexor"] is not before.muscles["flexor"]
    middle = after.surfaces["flexor"].vertices[:, 2].min() - before.surfaces["flexor"].vertices[:, 2].min()
    assert middle > 0.2
    again = editor.edit(CurveFile.model_validate(content()))
    np.testing.assert_allclose(again.functions.values, before.functions.values, atol=1e-12)


def faults_of(editor: CurveEditor, point: int, **fields: object) -> list[str]:
    edited = content()
    points = edited["muscles"]["flexor"]["curves"][0]["points"]
    points[point] = fields
    return [str(fault) for fault in editor.edit(CurveFile.model_validate(edited)).faults]


def test_a_curve_outside_the_skin_is_one_fault(editor: CurveEditor) -> None:
    [said] = faults_of(editor, 1, at=[0, 0, -24])
    assert said.startswith("arm.yaml: muscles.flexor.curves.0: ") and "mm of it lie outside the skin" in said
    assert faults_of(editor, 1, at=[0, 0, -19]) == []


def free_ends(*ends: int) -> dict[str, Any]:
    """The arm's curves, ends of the flexor off the bone."""
    edited = content()
    for end in ends:
        edited["muscles"]["flexor"]["curves"][0]["points"][end] = {"at": [28 * (1 if end else -1), 0, -13]}
    return edited


def distance_in(said: str) -> float:
    return float(said.partition("its origin lies ")[2].split()[0])


def test_a_muscle_without_attachment_is_one_fault(editor: CurveEditor) -> None:
    [said] = map(str, editor.edit(CurveFile.model_validate(free_ends(0, 2))).faults)
    assert said.startswith("arm.yaml: muscles.flexor: is attached to no bone: its origin lies ")
    assert distance_in(said) == pytest.approx(13 - 5, abs=0.4)  # the bone has flat triangles
    assert "reach of 3 mm" in said and "its insertion lies" in said
    edited = free_ends(0, 2)
    place = {"bone": "radius", "along": 0.1, "towards": [0, 0, -1]}
    edited["muscles"]["flexor"]["attachments"] = [{"end": "origin", "points": [place]}]
    found = editor.edit(CurveFile.model_validate(edited))
    assert not any("no bone" in str(fault) for fault in found.faults)


def test_a_muscle_with_one_end_off_the_bones_is_a_warning(editor: CurveEditor) -> None:
    """Lumbricals begin on tendons."""
    edited = editor.edit(CurveFile.model_validate(free_ends(0)))
    assert edited.faults == ()
    [said] = edited.warnings
    assert said.startswith("flexor: its origin lies ") and distance_in(said) == pytest.approx(8, abs=0.4)
    assert editor.edit(CurveFile.model_validate(content())).warnings == ()


def test_a_muscle_that_is_lost_is_named_and_the_others_stay(editor: CurveEditor) -> None:
    lost = content()
    lost["muscles"]["flexor"]["curves"][0]["points"] = [{"at": [500, 0, 0]}, {"at": [600, 0, 0]}]
    edited = editor.edit(CurveFile.model_validate(lost))
    assert list(edited.surfaces) == ["extensor", "abductor"]
    assert any("no part of it lies between skin and bones" in str(f) for f in edited.faults)
    weak = content()
    weak["muscles"]["flexor"]["curves"][0]["points"] = [
        {"at": [0, 0, -12], "tissue": 0.01},
        {"at": [5, 0, -12], "tissue": 0.01},
    ]
    assert any("nowhere the largest" in str(f) for f in editor.edit(CurveFile.model_validate(weak)).faults)


def test_there_may_be_no_muscle_yet(editor: CurveEditor, tmp_path: Path) -> None:
    edited = editor.edit(Draft())
    assert edited.surfaces == {} and edited.functions.names == ("fat",)
    with pytest.raises(InputError, match="Draw a muscle first"):
        write_curves(tmp_path / "none.yaml", Draft())
    assert not list(tmp_path.iterdir())


def test_a_written_file_reads_as_the_same_curves(tmp_path: Path) -> None:
    given = content()
    flexor = given["muscles"]["flexor"]
    flexor |= {"volume": 9000.1, "reach": 1 / 3, "fibres": "flow"}
    flexor["curves"][0]["normal"] = [0, 1, 1e-7]
    flexor["curves"][0]["points"][1]["spread"] = [0.5, 2.0]
    flexor["attachments"] = [{"end": "insertion", "points": [{"at": [1e-5, 2, 3]}]}]
    given["muscles"]["y"] = given["muscles"].pop("abductor")  # YAML 1.1 reads a plain y as true elsewhere
    file = CurveFile.model_validate(given)
    write_curves(tmp_path / "written.yaml", file)
    again = load_curves(tmp_path / "written.yaml")
    assert again == file
    assert content_of(again) == content_of(file)
    text = (tmp_path / "written.yaml").read_text(encoding="utf-8")
    assert "{bone: radius, along: 0.1, towards: [0.0, 0.0, -1.0], tissue: 1.0}" in text


def test_places_on_bones_are_near_where_a_point_is_dropped() -> None:
    distal = (1.0, 0.0, 0.0)
    for point in np.random.default_rng(0).normal(scale=(25, 6, 6), size=(40, 3)):
        place = place_on_bone(point, BONES, distal, "arm.yaml")
        wanted = Distance(BONES["radius"]).closest(point[None])[2][0]
        np.testing.assert_allclose(locate([place], BONES, distal, "arm.yaml", "p")[0], wanted, atol=0.02)
    with pytest.raises(InputError, match="'ulna' is no bone"):
        place_on_bone(np.zeros(3), BONES, distal, "arm.yaml", "ulna")


def test_the_file_of_a_hand_keeps_its_ligaments_tendons_and_nails(tmp_path: Path) -> None:
    hand = Path(__file__).parents[2] / "config/anatomy/hand.yaml"
    write_curves(tmp_path / "hand.yaml", load_draft(hand))
    assert load_hand(tmp_path / "hand.yaml") == load_hand(hand)


def test_a_tendon_is_a_line_through_its_points() -> None:
    places = [{"at": (x, 3.0 + 0.1 * x, -4.0)} for x in (20.0, 5.0, -15.0)]
    tendon = {"bone": "radius", "bones": ["radius"], "radius": 1.0, "points": places}
    draft = Draft.model_validate({"tendons": {"flexor": tendon}})
    line = tendon_lines(draft, arm(4.0)[1], "hand.yaml")["flexor"]
    assert line[0] == pytest.approx(places[0]["at"]) and line[-1] == pytest.approx(places[-1]["at"])
    assert line[:, 1] == pytest.approx(3.0 + 0.1 * line[:, 0])  # points on a line give this line
