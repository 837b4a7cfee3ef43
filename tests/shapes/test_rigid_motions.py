"""Rigid motions that attachments leave free, against Kabsch's solution and geometry."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from handpipe.core.rigid import RigidTransform
from handpipe.shapes.observations.correspondence import Correspondence
from handpipe.shapes.observations.rigid_motions import LooseMotions

X = np.random.default_rng(0).standard_normal((40, 3)) * [20.0, 8.0, 5.0]


def on_a_line() -> np.ndarray:
    x = X.copy()
    x[1], x[2] = x[0] + [5.0, 1.0, 2.0], x[0] + [10.0, 2.0, 4.0]
    return x


@pytest.mark.parametrize(("ids", "count"), [([], 6), ([0], 3), ([0, 1], 1), ([0, 1, 2], 1), ([0, 1, 3], 0)])
def test_held_points_leave_as_many_motions_as_geometry_says(ids: list[int], count: int) -> None:
    assert LooseMotions(on_a_line()[ids], X).count == count


def test_held_points_stay_where_they_are() -> None:
    x = on_a_line()
    motions = LooseMotions(x[[0, 1, 2]], x)
    moved = motions.transform(np.array([8.0]))(x)
    assert moved[:3] == pytest.approx(x[:3], abs=1e-10)
    assert np.linalg.norm(moved - x, axis=1).max() > 1.0


def test_transform_agrees_with_modes_to_first_order_and_is_rigid() -> None:
    motions = LooseMotions(np.zeros((0, 3)), X)
    amounts = np.random.default_rng(1).standard_normal(6)
    small = motions.transform(1e-6 * amounts)(X) - X
    assert small.ravel() == pytest.approx(1e-6 * motions.modes(X) @ amounts, abs=1e-9)
    large = motions.transform(20 * amounts)
    assert large.rotation @ large.rotation.T == pytest.approx(np.eye(3))


def test_a_free_body_settles_as_kabsch_places_it() -> None:
    rng = np.random.default_rng(2)
    turn = RigidTransform(Rotation.from_rotvec([0.4, -0.9, 0.3]).as_matrix(), np.array([7.0, 0.0, -3.0]))
    targets = turn(X) + 0.5 * rng.standard_normal(X.shape)
    points = Correspondence(sp.identity(len(X), format="csr"), targets, None)
    found = LooseMotions(np.zeros((0, 3)), X).settled(X, points)
    assert found == pytest.approx(RigidTransform.fit(X, targets)(X), abs=1e-6)
