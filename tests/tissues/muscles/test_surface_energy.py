"""Energies of a surface agree with their differences."""

import numpy as np
import pytest
import trimesh
from scipy.sparse.linalg import spsolve

from handpipe.fem.solver.equilibrium import solve
from handpipe.mesh.surfaces.surface import Surface
from handpipe.tissues.muscles.separation.surface_energy import KeptVolumes, Plate, thin_plate, volume_gradient


def ellipsoid() -> Surface:
    sphere = trimesh.creation.icosphere(subdivisions=1)
    return Surface(sphere.vertices * [3, 2, 1] + [1, 2, 3], sphere.faces)


def test_volume_gradient_agrees_with_differences():
    surface = ellipsoid()
    gradient = volume_gradient(surface)
    for vertex, axis in ((0, 0), (7, 2)):
        step = np.zeros_like(surface.vertices)
        step[vertex, axis] = 1e-5
        change = (
            surface.moved(surface.vertices + step).volume() - surface.moved(surface.vertices - step).volume()
        )
        assert gradient[vertex, axis] == pytest.approx(change / 2e-5, rel=1e-6)


def test_forces_are_derivatives_of_the_energies():
    surface = ellipsoid()
    rng = np.random.default_rng(0)
    x = surface.vertices + 0.1 * rng.normal(size=surface.vertices.shape)
    step = 1e-5 * rng.normal(size=x.shape)
    whole = [slice(0, len(x))]
    volumes = KeptVolumes([surface], whole, np.array([2.0]), 0.01)
    volumes.renew(x)
    assert volumes.pressures[0] != 0
    for energy in (Plate(thin_plate(surface, 2.0), surface.vertices), volumes):
        change = energy.value(x + step) - energy.value(x - step)
        assert 2 * np.vdot(energy.gradient(x), step) == pytest.approx(change, rel=1e-6)


def test_a_plate_resists_a_shift_by_its_area_alone():
    surface = ellipsoid()
    plate = Plate(thin_plate(surface, 5.0), surface.vertices)
    shift = np.array([0.3, 0.0, 0.4])
    assert plate.value(surface.vertices + shift) == pytest.approx(0.5 * surface.area() * 0.25, rel=1e-9)


def test_pressures_bring_volumes_back_while_the_shape_is_found():
    """Pressed flat between two planes, the body bulges sideways and keeps its volume."""
    surface = ellipsoid()
    stiffness = thin_plate(surface, 2.0)
    plate = Plate(stiffness, surface.vertices)
    compliance = np.vdot(volume_gradient(surface), spsolve(stiffness.tocsc(), volume_gradient(surface)))
    volumes = KeptVolumes([surface], [slice(0, len(surface.vertices))], np.array([compliance]), 0.004)
    x = surface.vertices.copy()
    x[:, 2] = np.clip(x[:, 2], 2.5, 3.5)
    pressed = np.zeros(x.shape, dtype=bool)
    pressed[:, 2] = x[:, 2] != surface.vertices[:, 2]
    empty = solve([plate], x, fixed=pressed).x
    assert not volumes.kept(empty)
    volumes.renew(empty)
    found = solve([plate, volumes], empty, fixed=pressed)
    assert found.record.converged and volumes.kept(found.x)
    assert surface.moved(found.x).volume() == pytest.approx(surface.volume(), rel=0.004)
    assert np.array_equal(found.x[pressed], x[pressed])
