import numpy as np
import pytest

from handpipe.core.rigid import RigidTransform
from handpipe.tissues.muscles.fitting.contraction import HANDLES, Contraction, contracted, fibres, slack, taut
from handpipe.tissues.muscles.fitting.soft_body import SoftBody

from .shapes import hinge, rod, spindle


def nearer(body, distance: float) -> dict[str, RigidTransform]:
    """The second bone moved towards the first along the muscle, by a distance in mm."""
    first, second = body.attachments
    offset = body.surface.vertices[body.attachments[second]].mean(axis=0)
    offset = body.surface.vertices[body.attachments[first]].mean(axis=0) - offset
    shift = distance * offset / np.linalg.norm(offset)
    return {first: RigidTransform.identity(), second: RigidTransform(np.eye(3), shift)}


def test_derivative_agrees_with_differences():
    body = spindle()
    search = Contraction(body, nearer(body, 2.0), body.mesh.vertices)
    weights, step = np.array([-0.1, 0.05, -0.2, 0.1]), 1e-4
    derivative = search(weights)[1]
    differences = [
        (search(weights + step * e)[0] - search(weights - step * e)[0]) / (2 * step) for e in np.eye(HANDLES)
    ]
    np.testing.assert_allclose(derivative, differences, rtol=2e-4, atol=1e-5 * np.abs(derivative).max())


def test_fibres_run_along_a_spindle():
    body = spindle()
    along = fibres(body, body.harmonic_weights()[:, 0])
    middle = np.abs(body.mesh.vertices[body.mesh.tets].mean(axis=1)[:, 0]) < 5.0
    assert np.abs(along[middle, 0]).mean() > 0.97


def test_a_muscle_shortens_and_thickens_instead_of_buckling():
    body = spindle()
    distance = 0.2 * np.ptp(body.surface.vertices[:, 0])
    transforms = nearer(body, distance)
    elastic = Contraction(body, transforms, body.mesh.vertices)
    passive, _ = elastic(np.zeros(HANDLES))
    x = contracted(body, transforms, body.mesh.vertices)
    held = body.attached(transforms)
    assert np.linalg.norm(held.errors(x), axis=1).max() < 0.3
    after = body.surface_at(x)
    assert after.volume() / body.surface.volume() == pytest.approx(1.0, abs=0.02)
    assert elastic(np.full(HANDLES, np.log(0.8)))[0] < 0.2 * passive
    # The belly's middle stays on the axis (within 1 % of the length) and is thicker by 1 / sqrt(length).
    belly = np.abs(body.surface.vertices[:, 0] - body.surface.vertices[:, 0].mean()) < 3.0
    before = body.surface.vertices[belly][:, 1:]
    now = after.vertices[belly][:, 1:]
    assert np.linalg.norm(now.mean(axis=0) - before.mean(axis=0)) < 0.3
    assert now.std() / before.std() == pytest.approx(1 / np.sqrt(0.8), rel=0.06)


def test_a_slender_muscle_pulled_taut_takes_the_short_way():
    """A rod over a hinge bent by 75 degrees: its middle is nearer to the straight line between its ends."""
    surface = rod(np.zeros(3), 44.0, 1.6)
    x = surface.vertices[:, 0]
    body = SoftBody.fill(surface, {"a": np.flatnonzero(x < -19), "b": np.flatnonzero(x > 19)}, 1.5)
    moved = hinge(np.radians(75), -10.0)
    ends = [moved[b](surface.vertices[ids]).mean(axis=0) for b, ids in body.attachments.items()]
    line = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    middle = np.abs(x) < 3.0

    def beside(vertices) -> float:
        off = body.surface_at(vertices).vertices[middle].mean(axis=0) - ends[0]
        return float(np.linalg.norm(off - (off @ line) * line))

    start = body.mesh.vertices
    loose, pulled = slack(body, moved, start), taut(body, moved, start)
    assert beside(pulled) < 0.75 * beside(loose)
    assert np.linalg.norm(body.attached(moved).errors(pulled), axis=1).max() < 0.5
