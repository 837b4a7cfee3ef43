import importlib.util
import sys

import numpy as np
import pytest

from handpipe.core.errors import HandpipeError, InputError
from handpipe.mesh.generation import meshing
from handpipe.mesh.generation.meshing import tetrahedralise
from handpipe.mesh.generation.remeshing import remesh
from handpipe.mesh.surfaces.surface import Surface, concatenate

from .shapes import box, sphere

ball = remesh(sphere(6, 4), 1.2)
with_gmsh = pytest.mark.skipif(importlib.util.find_spec("gmsh") is None, reason="gmsh is not installed")


@with_gmsh
def test_the_surface_is_kept_and_filled_without_slivers():
    mesh = tetrahedralise(ball, 1.2)
    np.testing.assert_array_equal(mesh.vertices[: len(ball.vertices)], ball.vertices)
    kept = {frozenset(t) for t in ball.triangles.tolist()}
    assert {frozenset(t) for t in mesh.boundary().triangles.tolist()} == kept
    assert mesh.boundary().volume() == pytest.approx(ball.volume())
    assert mesh.volumes().sum() == pytest.approx(ball.volume())
    assert mesh.smallest_dihedral() > 10
    assert mesh.dihedral_angles().max() < 165


@with_gmsh
def test_edge_length_rules_the_interior_and_meshes_repeat():
    fine, coarse, again = (tetrahedralise(ball, length) for length in (0.8, 3.0, 3.0))
    assert len(fine.tets) > 2 * len(coarse.tets)
    assert np.array_equal(coarse.vertices, again.vertices)
    assert np.array_equal(coarse.tets, again.tets)


@with_gmsh
def test_shells_that_face_inwards_are_holes():
    hole = remesh(sphere(2, 3), 0.8)
    shells = [ball, *(hole.moved(hole.vertices + [x, 0, 0]).flipped() for x in (-3, 3))]
    mesh = tetrahedralise(concatenate(shells), 1.2)
    assert mesh.volumes().sum() == pytest.approx(ball.volume() - 2 * hole.volume())
    with pytest.raises(InputError, match="2 closed parts"):
        tetrahedralise(concatenate([ball, hole]), 1.2)


@with_gmsh
def test_a_coarse_surface_can_be_remeshed_first():
    mesh = tetrahedralise(sphere(6, 5), 1.5, keep_surface=False)
    assert mesh.volumes().sum() == pytest.approx(288 * np.pi, rel=0.03)
    assert len(mesh.boundary_vertices()) < 1000
    assert mesh.smallest_dihedral() > 10


@with_gmsh
def test_a_surface_that_cuts_itself_is_refused():
    folded = ball.vertices.copy()
    folded[:, 2] -= 14 * np.exp(-(folded[:, :2] ** 2).sum(axis=1) / 4) * (folded[:, 2] > 0)
    with pytest.raises(InputError, match=r"cuts|overlap"):
        tetrahedralise(ball.moved(folded), 1.2)


def test_an_open_surface_is_refused():
    with pytest.raises(InputError, match="boundary edges"):
        tetrahedralise(Surface(box().vertices, box().triangles[1:]), 1.0)


def test_without_gmsh_one_is_told_how_to_get_it(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(HandpipeError, match="pip install"):
        tetrahedralise(ball, 1.2)


def test_a_missing_library_is_answered_with_its_packages(tmp_path, monkeypatch):
    broken = tmp_path / "python"
    message = "OSError: libGLU.so.1: cannot open shared object file"
    broken.write_text(f"#!/bin/sh\necho '{message}' >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: True)
    monkeypatch.setattr(sys, "executable", str(broken))
    with pytest.raises(HandpipeError, match="libglu1-mesa"):
        tetrahedralise(ball, 1.2)
    assert "libxft2" in meshing.LIBRARIES
