"""Mechanical fields of simulated frames: their values, and what meshio reads of their files."""

from pathlib import Path

import meshio
import numpy as np
import pytest
from tests.tissues.fat.limb import CORE, below, capsule, limb
from tests.tissues.muscles.shapes import hinge, hinge_bones, spindle

from handpipe.core.layers import Frame, Region, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.fem.elements import plasticity
from handpipe.hand.exports.export import write_vtu_series
from handpipe.hand.exports.mechanics import muscle_fibres, with_mechanics
from handpipe.mesh.tets.operators import mass_lumped
from handpipe.skeleton.posing.layer import BoneLayer
from handpipe.tissues.fat.layer import TissueLayer
from handpipe.tissues.ligaments.layer import LigamentLayer
from handpipe.tissues.muscles.layer import MuscleLayer
from handpipe.tissues.muscles.muscle import Examples, Muscle

PARENTS = {"b": "a"}


def plain(name: str, centre=(0.0, 0.0, 0.0)) -> Muscle:
    """A muscle without plastic strain."""
    return Muscle.fit(name, spindle(centre), Examples(PARENTS, "neutral", {}), {})[0]


def simulated(layer, angle: float):
    frame = Frame("bent", {}, hinge(angle))
    bones = {"bones": BoneLayer(hinge_bones()).solve(frame, {})}
    return frame, bones | {layer.name: layer.solve(frame, bones)}


@pytest.fixture(scope="module")
def pressed():
    """Two muscles that overlap in neutral, of which contact makes two that press on one another."""
    layer = MuscleLayer([plain("low"), plain("high", (0.0, 0.0, 4.5))])
    frame = simulated(layer, 0.0)
    return layer, frame, with_mechanics([frame], [layer], PARENTS)[0]


def test_fibres_of_a_spindle_run_along_it_and_stretch_as_it_does():
    layer = MuscleLayer([plain("m")], contact=False)
    fibres = muscle_fibres([layer], PARENTS)["m_mesh"]
    body = layer.muscles[0].body
    middle = np.abs(body.mesh.vertices[body.mesh.tets].mean(axis=1)[:, 0]) < 9
    assert fibres[middle, 0].min() > 0.9  # from bone "a" to its child "b"
    rest = body.mesh.vertices
    stretched = {"m_mesh": Shape(rest, rest * [1.2, 0.9, 0.9], body.mesh.tets)}
    frame = Frame("rest", {}, hinge(0.0))
    [(_, found)] = with_mechanics([(frame, {"muscles": stretched})], [layer], PARENTS)
    fields = found["muscles"]["m_mesh"].fields
    expected = np.sqrt((1.2 * fibres[:, 0]) ** 2 + 0.81 * (fibres[:, 1:] ** 2).sum(axis=1))
    np.testing.assert_allclose(fields["fibre_stretch"], expected)
    strain = np.diag([0.5 * (1.44 - 1), 0.5 * (0.81 - 1), 0.5 * (0.81 - 1)]).ravel()
    np.testing.assert_allclose(fields["green_strain"], np.tile(strain, (len(middle), 1)), atol=1e-12)
    np.testing.assert_allclose(fields["elastic_green_strain"], fields["green_strain"], atol=1e-12)


def test_a_muscle_at_one_bone_has_no_fibre_stretch(caplog):
    body = spindle()
    attached = {"a": body.attachments["a"], "b": body.attachments["b"][:0]}
    muscle = plain("m")
    muscle.body.attachments.update(attached)
    assert muscle_fibres([MuscleLayer([muscle], contact=False)], PARENTS) == {}
    assert "m: no fibre stretch" in caplog.text


def test_muscles_press_where_they_touch_with_equal_forces(pressed):
    layer, (_, shapes), (_, found) = pressed
    forces = []
    for muscle in layer.muscles:
        shape, surface = found["muscles"][muscle.name], muscle.body.surface
        pressure = shape.fields["contact_pressure"]
        posed = surface.moved(shape.vertices)
        towards = 2.25 - posed.vertices[:, 2] if muscle.name == "low" else posed.vertices[:, 2] - 2.25
        assert (
            np.abs(towards[pressure > 0.05 * pressure.max()]).max() < 0.8
        )  # mm from the middle between them
        area = mass_lumped(posed.vertices, posed.triangles)
        forces.append(((pressure * area)[:, None] * -posed.vertex_normals()).sum(axis=0))
    assert forces[0][2] < -1.0  # mN: the lower one is pushed down
    np.testing.assert_allclose(forces[0][2], -forces[1][2], rtol=0.1)


def test_a_frame_keeps_the_bodies_with_fields_alone(pressed):
    _, _, (frame, found) = pressed
    assert frame.name == "bent" and set(found) == {"muscles"}
    assert set(found["muscles"]["low"].fields) == {"contact_pressure"}
    names = {
        "green_strain", "elastic_green_strain", "plastic_deformation", "cauchy_stress", "von_mises_stress",
        "fibre_direction", "fibre_stretch",
    }  # fmt: skip
    assert set(found["muscles"]["low_mesh"].fields) == names


def test_ligaments_are_stressed_and_bones_press_on_them():
    layer = LigamentLayer([plain("l")])
    [(_, found)] = with_mechanics([simulated(layer, 0.3)], [layer], PARENTS)
    assert set(found["ligaments"]["l"].fields) == {"contact_pressure"}
    assert found["ligaments"]["l_mesh"].fields["von_mises_stress"].max() > 1.0
    assert muscle_fibres([MuscleLayer([plain("l")])], PARENTS) and not muscle_fibres([layer], PARENTS)


def test_the_pressure_of_tissue_does_the_work_of_its_elasticity():
    """Virtual work of the displacement (0, y, z): it is linear, so that embedded points have it exactly."""
    tissue, posed = limb(Region.contact), capsule(CORE, 1.0).vertices * [1.0, 1.3, 1.3]
    layer, around = TissueLayer("skin", tissue), below(posed, Region.contact)
    core = {"core": RigidTransform.identity()}
    shapes = around | {"skin": layer.solve(Frame("thick", {}, core), around)}
    x = shapes["skin"]["skin_mesh"].vertices
    found = layer.contact_pressures(Frame("thick", {}, core), shapes)
    assert set(found) == {"skin", "bones"} and not found["skin"]["skin"].any()
    surface = capsule(CORE, 1.0).moved(posed)
    area, across = mass_lumped(surface.vertices, surface.triangles), np.array([0.0, 1.0, 1.0])
    pressure = found["bones"]["core"]
    work = (
        pressure * area * np.einsum("ni,ni->n", surface.vertex_normals(), surface.vertices * across)
    ).sum()
    elastic = (layer.elastic_bodies(core)["skin_mesh"].gradient(x) * (x * across)).sum()
    constraints = [
        p for p in layer.load_case(core, around).constraints(x) if not getattr(p, "one_sided", False)
    ]
    fixed = sum((p.gradient(x) * (x * across)).sum() for p in constraints)
    assert work > 10.0  # µJ
    assert work == pytest.approx(elastic + fixed, rel=0.1)


def test_the_fields_are_read_by_meshio(pressed, tmp_path: Path):
    layer, _, found = pressed
    write_vtu_series(tmp_path, [found])
    body = layer.muscles[0].body
    mesh = meshio.read(tmp_path / "muscles" / "low_mesh-0000.vtu")
    elastic = layer.elastic_bodies(hinge(0.0))["low_mesh"]
    x = found[1]["muscles"]["low_mesh"].vertices
    stress = mesh.cell_data_dict["cauchy_stress"]["tetra"].reshape(-1, 3, 3)
    np.testing.assert_allclose(stress, elastic.cauchy_stresses(x))
    plastic = mesh.cell_data_dict["plastic_deformation"]["tetra"].reshape(-1, 3, 3)
    np.testing.assert_allclose(plasticity.from_matrices(plastic), plasticity.identity(len(body.mesh.tets)))
    surface = meshio.read(tmp_path / "muscles" / "low-0000.vtu")
    assert surface.point_data["contact_pressure"].shape == (len(body.surface.vertices),)
