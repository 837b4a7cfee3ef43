"""Other starts that lead to the same shape of the frame, away from it, or to no result."""

from dataclasses import replace

import numpy as np
import pytest

from handpipe.core.errors import ConvergenceError
from handpipe.core.layers import Frame, Region
from handpipe.core.rigid import RigidTransform
from handpipe.tissues.fat import layer as layer_module
from handpipe.tissues.fat.layer import TissueLayer
from handpipe.tissues.fat.other_equilibria import BLEND, restarts

from .limb import below, limb

RIGHT = RigidTransform(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([5.0, 0, 0]))


def simulated(bone: RigidTransform, name: str = "plain"):
    """The limb's layer, a frame, and its shapes; its bone is thicker than in neutral: energy is not zero."""
    layer = TissueLayer("fat", limb(Region.fixed))
    frame = Frame(name, {}, {"core": bone})
    shapes = below(bone(1.05 * below()["bones"]["core"].rest))
    return layer, frame, shapes | {"fat": layer.solve(frame, shapes)}


def pushed(shapes, shift):
    """The shapes with the fat's tets elsewhere, as if it rested there."""
    tets = shapes["fat"]["fat_mesh"]
    return shapes | {"fat": shapes["fat"] | {"fat_mesh": replace(tets, vertices=tets.vertices + shift)}}


def test_starts_that_lead_to_the_same_shape_are_no_other_equilibria():
    layer, frame, shapes = simulated(RIGHT)
    _, other, known = simulated(RigidTransform.identity(), "before")
    found = restarts(layer, frame, shapes, [(other, known)])
    assert [restart.start for restart in found] == [BLEND, "before"]
    for restart in found:
        assert restart.settled and not restart.other
        assert restart.largest < 1e-3 and restart.energy == pytest.approx(1.0, abs=1e-3)


def test_a_shape_that_is_left_from_elsewhere_is_named_with_its_distance(caplog):
    layer, frame, shapes = simulated(RIGHT)
    shift = np.array([0.0, 0.0, 0.2])
    [restart] = restarts(layer, frame, pushed(shapes, shift))
    assert restart.other
    assert restart.mean == pytest.approx(0.2, abs=1e-3) and restart.largest == pytest.approx(0.2, abs=1e-3)
    assert "there is another equilibrium. Its skin is up to 0.20 mm from the frame's" in caplog.text
    assert caplog.text.rstrip().endswith(f"start: {BLEND}")
    [restart] = restarts(layer, frame, pushed(shapes, 0.1 * shift))
    assert not restart.other and restart.largest == pytest.approx(0.02, abs=1e-3)


def test_a_start_without_a_result_says_why(monkeypatch):
    layer, frame, shapes = simulated(RIGHT)

    def fail(*_):
        raise ConvergenceError("soft tissue", "did not converge", "Bend less")

    monkeypatch.setattr(layer_module, "at_rest", fail)
    [restart] = restarts(layer, frame, shapes)
    assert "did not converge" in restart.reason and not restart.other and not restart.settled
