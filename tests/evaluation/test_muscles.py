"""Errors of muscles and their depths, on spheres where both are known."""

import numpy as np
import pytest
import trimesh

from handpipe.evaluation.muscles import deepest, error_rows, surface_errors
from handpipe.mesh.surfaces.surface import Surface


def sphere(radius: float, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Surface:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    return Surface(np.asarray(ball.vertices) + centre, np.asarray(ball.faces))


def test_a_muscle_that_is_swollen_is_off_by_its_swelling_everywhere():
    true = {"adductor": sphere(5.0), "opponens": sphere(3.0), "unknown": sphere(1.0)}
    errors = surface_errors({"adductor": sphere(5.3), "opponens": sphere(3.0), "own": sphere(2.0)}, true)
    assert list(errors) == ["adductor", "opponens"]
    rows = error_rows({"fist": errors}, {"fist": "example"})
    assert [(r["muscle"], r["pose"], r["role"]) for r in rows] == [
        ("adductor", "fist", "example"),
        ("opponens", "fist", "example"),
    ]
    assert rows[0]["mean"] == pytest.approx(0.3, abs=0.01)
    assert rows[0]["max"] == pytest.approx(0.3, abs=0.01)
    assert rows[1]["max"] == pytest.approx(0.0, abs=1e-6)


def test_depth_counts_in_bones_and_in_neighbours_but_not_where_a_bone_holds():
    a, b = sphere(5.0), sphere(5.0, (9.0, 0.0, 0.0))  # one mm of overlap along x
    none = np.array([], dtype=np.int64)
    assert deepest({"a": a, "b": b}, {"a": none, "b": none}, []) == pytest.approx(1.0, abs=0.02)
    bone = sphere(2.0, (-6.5, 0.0, 0.0))  # half a mm
    assert deepest({"a": a}, {"a": none}, [bone]) == pytest.approx(0.5, abs=0.02)
    held = np.flatnonzero(a.vertices[:, 0] < -3.0)
    assert deepest({"a": a}, {"a": held}, [bone]) == 0.0
