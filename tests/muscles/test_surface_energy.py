"""Energies of a surface agree with their differences."""

import numpy as np
import pytest
import trimesh

from handpipe.mesh.surface import Surface
from handpipe.muscles.surface_energy import Plate, Pressure, thin_plate, volume_gradient


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
    for energy in (
        Plate(thin_plate(surface, 2.0), surface.vertices),
        Pressure([surface], whole, np.array([0.7])),
    ):
        change = energy.value(x + step) - energy.value(x - step)
        assert 2 * np.vdot(energy.gradient(x), step) == pytest.approx(change, rel=1e-6)


def test_a_plate_resists_a_shift_by_its_area_alone():
    surface = ellipsoid()
    plate = Plate(thin_plate(surface, 5.0), surface.vertices)
    shift = np.array([0.3, 0.0, 0.4])
    assert plate.value(surface.vertices + shift) == pytest.approx(0.5 * surface.area() * 0.25, rel=1e-9)
