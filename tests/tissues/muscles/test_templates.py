"""A template hand that is a turned, scaled and bent copy of the subject's comes back."""

import numpy as np
import pytest
import trimesh
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from handpipe.anatomy.shipped import HAND
from handpipe.core.errors import InputError
from handpipe.mesh.files import read_surface
from handpipe.mesh.generation import remesh
from handpipe.mesh.surfaces.distance import surface_errors
from handpipe.mesh.surfaces.surface import Surface
from handpipe.synthetic.phantom import phantom_bones
from handpipe.tissues.muscles.fitting.attachment_files import read_attachments
from handpipe.tissues.muscles.fitting.template_bones import fit_similarity, register_bones
from handpipe.tissues.muscles.fitting.template_placement import BoneWarp, place


def bone(centre, lengths) -> Surface:
    """A bone with a knob, so that its roll shows."""
    sphere = trimesh.creation.icosphere(subdivisions=4)
    unit = sphere.vertices
    knob = 1 + 0.35 * np.exp(-8 * ((unit - [0.8, 0.6, 0.0]) ** 2).sum(axis=1))
    return Surface(unit * knob[:, None] * lengths + centre, sphere.faces)


def subject() -> tuple[dict[str, Surface], Surface]:
    bones = {"a": bone([0.0, 0, 0], [25.0, 6, 5]), "b": bone([48.0, 0, 0], [20.0, 5, 4])}
    sphere = trimesh.creation.icosphere(subdivisions=3)
    return bones, Surface(sphere.vertices * [25, 3, 3] + [22, 9, 3], sphere.faces)


def distort(points):
    bent = points + 0.0015 * points[:, :1] ** 2 * [0, 0, 1]
    return 1.1 * Rotation.from_rotvec([0.4, 0.2, -0.3]).apply(bent) + [20, -5, 3]


def test_bones_and_the_muscle_between_them_are_carried_back():
    bones, muscle = subject()
    warp = BoneWarp({n: s.moved(distort(s.vertices)) for n, s in bones.items()}, bones)
    template = muscle.moved(distort(muscle.vertices))
    x = muscle.vertices[:, 0]
    attachments = {"a": np.flatnonzero(x < 3), "b": np.flatnonzero(x > 41)}
    top = muscle.vertices[np.argmax(muscle.vertices[:, 2])]
    guess = place(template, attachments, warp, 1.5, {"top": distort(top[None])[0]})
    assert surface_errors(guess.surface, muscle).max() < 1.2
    assert np.linalg.norm(guess.surface.vertices[guess.landmarks["top"]] - top) < 1.5
    ends = {n: guess.surface.vertices[ids][:, 0] for n, ids in guess.attachments.items()}
    assert ends["a"].max() < 5 and ends["b"].min() > 39 and min(map(len, ends.values())) >= 3


def test_a_slender_template_keeps_its_volume_whatever_edge_is_asked_for():
    """A rod of 1.2 mm radius, around which five edges of 1.5 mm reach."""
    rod = trimesh.creation.capsule(height=30.0, radius=1.2, count=[48, 48])
    surface = Surface(np.asarray(rod.vertices), np.asarray(rod.faces))
    z = surface.vertices[:, 2]
    held = {"a": np.flatnonzero(z < z.min() + 2), "b": np.flatnonzero(z > z.max() - 2)}
    guess = place(surface, held, lambda points: points, 1.5)
    assert guess.surface.volume() == pytest.approx(surface.volume(), rel=0.06)
    stout = surface.moved(4 * surface.vertices)
    edges = place(stout, held, lambda points: points, 1.5).surface.edge_lengths()
    assert np.median(edges) == pytest.approx(1.5, rel=0.15)


def test_a_thin_end_stays_where_it_is_attached():
    """The last 2 mm are 1.5 mm wide and 0.7 mm thick: edges of 1.1 mm cut them off."""
    sphere = trimesh.creation.icosphere(subdivisions=6)
    unit = np.asarray(sphere.vertices)
    taper = np.clip((1.0 - unit[:, 0]) / 0.8, 0.2, 1.0)[:, None] ** [1.0, 1.5]
    surface = Surface(
        np.column_stack([16.0 * unit[:, :1], 8.0 * unit[:, 1:] * taper]), np.asarray(sphere.faces)
    )
    x = surface.vertices[:, 0]
    assert remesh(surface, 1.1).vertices[:, 0].max() < x.max() - 2.0
    held = {"tip": np.flatnonzero(x > x.max() - 2.0), "a": np.flatnonzero(x < x.min() + 2.0)}
    guess = place(surface, held, lambda points: points, 1.1)
    assert len(guess.attachments["tip"]) >= 3
    assert guess.surface.vertices[:, 0].max() > x.max() - 1.5


def test_similarity_is_exact_on_similar_points():
    points = np.random.default_rng(0).standard_normal((30, 3))
    turned = 1.7 * Rotation.from_rotvec([1.0, 0.5, 2.0]).apply(points) + [1, 2, 3]
    assert fit_similarity(points, turned)(points) == pytest.approx(turned)


def test_wrong_attachments_name_the_bone(tmp_path):
    path = tmp_path / "m.json"
    path.write_text('{"a": [0, 1, 99999]}')
    with pytest.raises(InputError, match="a: has ids outside"):
        read_attachments(path, subject()[1])


def test_a_template_of_two_pieces_is_refused_where_a_bone_holds_the_smaller_one():
    """The message names the file, the bone and what to do."""
    sphere = trimesh.creation.icosphere(subdivisions=3)
    count = len(sphere.vertices)
    both = Surface(
        np.concatenate([sphere.vertices * 8, sphere.vertices * 4 + [20, 0, 0]]),
        np.concatenate([sphere.faces, sphere.faces + count]),
    )
    held = {"a": np.arange(30), "b": np.arange(count, count + 30)}
    with pytest.raises(InputError, match=r"ligament\.json.*b.*smaller part.*one piece"):
        place(both, held, lambda points: points, 1.5, source="ligament.json")
    guess = place(both, {"a": held["a"]}, lambda points: points, 1.5)
    assert guess.surface.vertices[:, 0].max() < 8.1


def test_bones_in_a_line_are_turned_as_their_own_shapes_tell():
    """A finger's bones of other shapes: one similarity of all four fits as well turned by any angle."""
    known = {name: b.surface(b.whole, 0.8) for name, b in phantom_bones.bones().items()}
    templates = {name: read_surface(HAND / f"bones/{name}.ply") for name in known}
    maps, rival = register_bones(templates, {name: Surface(*parts) for name, parts in known.items()})
    assert rival is None or rival.turned > rival.error
    across = [polar(to.matrix)[0] @ [0.0, 1.0, 0.0] for to in maps.values()]  # both have radial along y
    assert np.degrees(np.arccos([axis[1] for axis in across])).max() < 20.0


def test_bones_that_no_turn_suits_better_are_named_in_doubt(caplog):
    round_bones = {n: capsule(x) for n, x in (("a", 0.0), ("b", 45.0), ("c", 85.0))}
    _, rival = register_bones(round_bones, {n: s.moved(1.1 * s.vertices) for n, s in round_bones.items()})
    assert rival is not None and rival.turn > 75.0 and rival.turned < 1.25 * rival.error
    assert "turned by" in caplog.text and "check where muscles lie" in caplog.text


def capsule(x: float) -> Surface:
    mesh = trimesh.creation.capsule(height=25.0, radius=5.0)
    return Surface(mesh.vertices[:, ::-1] + [x, 0.0, 0.0], mesh.faces[:, ::-1])
