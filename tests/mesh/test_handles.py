"""Handles are counted, cut where they are bridges, and filled where they are holes, at their places."""

import numpy as np
import pytest
import trimesh
from tests.mesh.shapes import FINGERS, two_fingers

from handpipe.mesh.contact import cuts_itself
from handpipe.mesh.generation import genus, remesh, without_handles
from handpipe.mesh.surfaces import Distance, Surface

LONGEST = 20.0  # mm: the fingers are 25 mm around


def torus(major: float, minor: float) -> Surface:
    mesh = trimesh.creation.torus(major, minor, major_sections=64, minor_sections=24)
    return Surface(mesh.vertices, mesh.faces)


@pytest.mark.parametrize("bridges", [(), (15.0,), (12.0, 20.0, 28.0)])
def test_handles_are_counted(bridges):
    assert genus(two_fingers(*bridges)) == len(bridges)


@pytest.mark.parametrize(("major", "minor", "bridge"), [(10.0, 3.0, True), (10.0, 8.5, False)])
def test_a_ring_is_cut_where_it_is_thin_and_filled_where_its_hole_is_small(major, minor, bridge):
    found, [handle] = without_handles(torus(major, minor), 30.0)
    assert genus(found) == 0 and handle.bridge == bridge
    assert handle.around == pytest.approx(2 * np.pi * min(minor, major - minor), rel=0.02)


@pytest.mark.parametrize("bridges", [(15.0,), (12.0, 20.0)])
def test_bridges_between_fingers_are_cut(bridges):
    found, handles = without_handles(two_fingers(*bridges), LONGEST)
    assert genus(found) == 0 and found.is_closed() and not cuts_itself(found) and found.volume() > 0
    assert all(h.bridge and h.around == pytest.approx(2 * np.pi * 0.8, rel=0.3) for h in handles)
    assert sorted(h.place[0] for h in handles) == pytest.approx(sorted(bridges), abs=0.6)
    assert [h.place[1] for h in handles] == pytest.approx([0.5 * FINGERS] * len(bridges), abs=0.6)
    off = Distance(two_fingers()).closest(found.vertices)[0]
    assert off.max() < 0.5
    assert "Cut a bridge" in str(handles[0])


def test_fingers_joined_along_a_length_come_apart():
    """A bridge of 6 mm length is cut along its length."""
    joined = two_fingers(*np.arange(14.0, 19.0, 0.5), radius=0.6)
    assert genus(joined) == 1
    found, [handle] = without_handles(joined, LONGEST)
    assert genus(found) == 0 and handle.bridge and 11 < handle.around < 16
    assert (
        Distance(found).depths(np.array([[18.0, 0.5 * FINGERS, 0.0], [15.0, 0.5 * FINGERS, 0.0]])).max() == 0
    )
    assert Distance(two_fingers()).closest(found.vertices)[0].max() < 1.5


def test_no_finger_is_cut_off():
    """Joined over most of their length: the shortest loop would be around a finger."""
    joined = two_fingers(*np.arange(14.0, 33.0, 0.5), radius=0.6)
    found, handles = without_handles(joined, LONGEST)
    assert genus(found) == 1 and not handles and np.array_equal(found.vertices, joined.vertices)


def test_a_hole_through_a_body_is_filled():
    plate = trimesh.creation.annulus(1.0, 12.0, 5.0, sections=32)
    body = remesh(Surface(plate.vertices, plate.faces), 0.7)
    assert genus(body) == 1
    found, [handle] = without_handles(body, LONGEST)
    assert genus(found) == 0 and not handle.bridge and np.linalg.norm(handle.place[:2]) < 0.3
    assert found.contains(handle.place[None])[0]
    assert Distance(body).closest(found.vertices)[0].max() < 1.0


def test_a_surface_without_handles_stays_as_it_is():
    surface = two_fingers()
    assert without_handles(surface, LONGEST) == (surface, [])
