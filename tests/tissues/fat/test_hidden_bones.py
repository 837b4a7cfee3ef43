"""How far a bone comes out of the skin, and skin that makes way for it: balls in balls, a bone in a limb."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy import sparse

from handpipe.core.layers import Region, Shape
from handpipe.fem.contact import Contact
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets import mass_lumped
from handpipe.tissues.fat.hidden_bones import COVER, HiddenBones
from handpipe.tissues.fat.resting import LoadCase, pressures_at, settled_from
from handpipe.tissues.fat.skin import Rigid

from .limb import at_rest, below, capsule, limb


def ball(radius: float, subdivisions: int = 4) -> Surface:
    made = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Surface(np.array(made.vertices), np.array(made.faces))


def test_the_distance_is_that_of_the_balls() -> None:
    skin, bone = ball(8.0), ball(4.0)
    hidden = HiddenBones(skin)
    for shift in (0.0, 3.8, 5.0, 7.0):
        posed = Shape(bone.vertices, bone.vertices + [0.0, shift, 0.0], bone.triangles)
        expected = max(shift + 4.0 - 8.0, 0.0)
        assert hidden.outside(skin, {"bone": posed}) == pytest.approx(expected, abs=0.06)


def test_what_the_neutral_skin_does_not_hide_does_not_count() -> None:
    """A bone that the cut end of a limb leaves half outside."""
    skin, bone = ball(8.0), ball(4.0)
    cut = Shape(bone.vertices + [0.0, 8.0, 0.0], bone.vertices + [0.0, 8.0, 0.0], bone.triangles)
    hidden = HiddenBones(skin)
    assert hidden.outside(skin, {"cut": cut}) == 0.0
    assert hidden.outside(skin, {}) == 0.0
    lifted = Shape(cut.rest, cut.vertices + [0.0, 1.0, 0.0], bone.triangles)
    # watched vertices are a millimetre apart: the highest that the neutral skin hides is a little below it
    assert 0.75 < hidden.outside(skin, {"cut": lifted}) <= 1.0


def contacts(bone: Shape) -> list[Contact]:
    """Contact of a ball of skin with a bone."""
    skin = ball(8.0)
    identity = sparse.identity(len(skin.vertices), format="csr")
    return list(HiddenBones(skin).contact(skin, {"bone": bone}, identity, 1.0))


def test_skin_in_a_bone_is_pushed_out_of_it() -> None:
    """Each place inside the moved ball, or nearer than the cover, and no other, straight out of the ball."""
    bone, shift = ball(4.0, 5), np.array([0.0, 4.8, 0.0])
    [contact] = contacts(Shape(bone.vertices, bone.vertices + shift, bone.triangles))
    places = contact.points(ball(8.0).vertices)
    out = places - shift
    height = np.linalg.norm(out, axis=1)
    force = -contact.forces(places)
    pushed = np.linalg.norm(force, axis=1) > 0
    assert pushed[height < 4.0 + COVER - 0.01].all() and not pushed[height > 4.0 + COVER + 0.01].any()
    along = np.einsum("ni,ni->n", force, out)[pushed] / height[pushed]
    assert along == pytest.approx(np.linalg.norm(force[pushed], axis=1), rel=1e-2)
    cap = 2 * np.pi * 8.0 * (8.0 - (8.0**2 + 4.8**2 - 5.0**2) / 9.6)  # of skin inside a ball of radius 5
    assert contact.stiffness.sum() == pytest.approx(cap, rel=0.05)


@pytest.mark.parametrize("shift", [0.0, 6.0])
def test_a_bone_far_from_the_skin_or_deep_in_it_has_no_contact(shift: float) -> None:
    bone = ball(4.0)
    assert contacts(Shape(bone.vertices, bone.vertices + [0.0, shift, 0.0], bone.triangles)) == []


def test_skin_that_lies_in_a_bone_in_neutral_is_left_there() -> None:
    """That of the cut end of a limb, a bone half outside; the skin around it is next to the bone."""
    bone = ball(4.0)
    cut = Shape(bone.vertices + [0.0, 8.0, 0.0], bone.vertices + [0.0, 8.0, 0.0], bone.triangles)
    assert not any(contact.forces(contact.points(ball(8.0).vertices)).any() for contact in contacts(cut))


def test_a_bone_moves_the_skin_that_would_let_it_through(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tissue touches the bone on one side alone, and the skin of that side stays in place."""
    whole, core = limb(Region.contact), capsule(2.0, 1.0)
    still = np.flatnonzero(whole.skin.vertices[:, 1] < 2.0)
    bare = whole.inner.chosen(whole.inner.rest[:, 1] < 0)
    tissue = replace(whole, rigid={"tip": Rigid("core", still)}, inner=bare)

    def settled() -> tuple[LoadCase, np.ndarray]:
        x = tissue.mesh.vertices
        for height in (4.0, 4.5, 5.0):  # mm: the skin is not deep in the bone at any start
            posed = below(core.vertices + [0.0, height, 0.0], Region.contact)
            case = LoadCase.of(tissue, posed, at_rest())
            x = settled_from(case, x).x
        return case, x

    def outside() -> float:
        case, x = settled()
        skin = case.skin(x)
        mesh = trimesh.Trimesh(skin.vertices, skin.triangles)
        core_at = case.below["bones"]["core"].vertices
        return -float(trimesh.proximity.signed_distance(mesh, core_at).min())

    assert outside() < 0.15  # edges of the skin are as long as the bone's radius
    case, x = settled()
    pressure, skin = pressures_at(case, x)[""]["skin"], case.skin(x)
    pressed = pressure > 0.01 * pressure.max()
    assert pressed.any() and skin.vertices[pressed, 1].min() > 3.0  # above the bone alone
    force = (pressure * mass_lumped(skin.vertices, skin.triangles)) @ skin.vertex_normals()
    monkeypatch.setattr(HiddenBones, "contact", lambda *_: list[Contact]())
    others = np.sum([potential.gradient(x) for potential in case.constraints(x)], axis=(0, 1))
    assert force[1] == pytest.approx(others[1], rel=0.1)  # what holds the tissue balances the bone
    assert outside() > 1.0
