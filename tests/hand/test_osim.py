"""The model of OpenSim, loaded and moved by OpenSim itself."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from tests.hand.test_mjcf import every_type, manufactured, with_a_ring
from tests.tissues.tendons.finger import pose

from handpipe.hand.exports.bone_files import BONE_DENSITY, solid
from handpipe.hand.exports.osim import write_osim
from handpipe.tissues.tendons.straight_path import bone_path

opensim = pytest.importorskip("opensim", reason="opensim is not installed", exc_type=ImportError)
opensim.Logger.removeFileSink()  # else it writes a log into the working folder


def loaded(path: Path):
    model = opensim.Model(str(path))
    return model, model.initSystem()


def posed(model, state, angles: dict[str, float]) -> None:
    coordinates = model.getCoordinateSet()
    for name, value in angles.items():
        coordinates.get(name).setValue(state, float(value), False)
    model.realizePosition(state)


def test_bodies_move_as_the_rig_without_residuals(tmp_path: Path) -> None:
    rig = every_type()
    model, state = loaded(write_osim(tmp_path / "model", rig))
    rng = np.random.default_rng(0)
    for _ in range(20):
        angles = {name: rng.uniform(*rig.limits[name]) for name in rig.angle_names}
        posed(model, state, angles)
        for bone, transform in rig.bone_transforms(angles).items():
            found = model.getBodySet().get(bone).getTransformInGround(state)
            matrix, place = found.R().asMat33(), found.p()
            turned = [[matrix.get(i, j) for j in range(3)] for i in range(3)]
            np.testing.assert_allclose(turned, transform.rotation, atol=1e-9)
            moved = [1e3 * place.get(i) for i in range(3)]
            np.testing.assert_allclose(moved, transform.translation, atol=1e-7)


def test_bodies_have_the_masses_of_bones(tmp_path: Path) -> None:
    rig = with_a_ring(every_type())
    model, _ = loaded(write_osim(tmp_path / "model", rig))
    for bone, surface in rig.surfaces.items():
        body, mesh = model.getBodySet().get(bone), trimesh.Trimesh(surface.vertices, surface.triangles)
        assert body.getMass() == pytest.approx(1e-9 * mesh.volume * BONE_DENSITY, rel=1e-9)
        centre = [1e3 * body.getMassCenter().get(i) for i in range(3)]
        np.testing.assert_allclose(centre, mesh.center_mass, atol=1e-9)


def test_a_bone_with_a_hole_has_the_mass_of_its_hull() -> None:
    mesh = trimesh.creation.box([2.0, 2, 2])
    mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    assert solid(mesh).mass == pytest.approx(8 * BONE_DENSITY)


def test_coordinates_have_the_limits_of_angles(tmp_path: Path) -> None:
    rig = every_type()
    model, _ = loaded(write_osim(tmp_path / "model", rig))
    found = model.getCoordinateSet()
    assert found.getSize() == len(rig.angle_names)
    for name, limits in rig.limits.items():
        coordinate = found.get(name)
        assert (coordinate.getRangeMin(), coordinate.getRangeMax()) == pytest.approx(limits)


@pytest.mark.parametrize("kind", ["extensor", "flexor"])
def test_moment_arms_are_the_differences_of_the_paths_length(kind: str, tmp_path: Path) -> None:
    tendon, rig = manufactured(kind)
    poses = [pose(a, b) for a, b in ((0, 0), (1.0, 0.0), (0.0, 0.8), (1.4, 0.9))]
    path = bone_path(tendon, [tendon.solve(bones).x for bones in poses], poses)
    model, state = loaded(write_osim(tmp_path / "model", rig, [path]))
    actuator = opensim.PathActuator.safeDownCast(model.getForceSet().get(tendon.name))
    angles, step = {"middle": 0.6, "distal": 0.4}, 1e-5
    posed(model, state, angles)
    line = actuator.getGeometryPath()
    assert 1e3 * line.getLength(state) == pytest.approx(path.length(rig.bone_transforms(angles)), abs=1e-6)
    for name in rig.angle_names:
        sides = [path.length(rig.bone_transforms(angles | {name: angles[name] + s})) for s in (step, -step)]
        arm = 1e3 * line.computeMomentArm(state, model.getCoordinateSet().get(name))
        assert arm == pytest.approx(-(sides[0] - sides[1]) / (2 * step), abs=1e-3)
