"""Which vertices of overlapping muscles bones go on holding."""

import numpy as np
import pytest

from handpipe.core.errors import ConvergenceError
from handpipe.mesh.surfaces.distance import Distance
from handpipe.tissues.muscles.separation import contested
from handpipe.tissues.muscles.separation.contested import (
    CLEAR,
    LEAST_ATTACHED,
    drop_contested,
    separate_posed,
)
from handpipe.tissues.muscles.separation.disjoint_start import Inseparable
from handpipe.tissues.muscles.separation.separation import Separation

from .shapes import spindle


def test_attached_vertices_inside_a_neighbour_are_released():
    """Two spindles side by side, whose ends lie in one another; a third is far away."""
    bodies = {"one": spindle(), "two": spindle((1.0, 0.5, 1.0)), "far": spindle((0.0, 30.0, 0.0))}
    found = drop_contested(bodies)
    for name, other in (("one", "two"), ("two", "one")):
        surface = Distance(bodies[other].surface)
        for bone, ids in found[name].attachments.items():
            before = bodies[name].attachments[bone]
            outside = surface.signed(bodies[name].surface.vertices[before])[0] > CLEAR
            assert not outside.all()
            assert set(before[outside]) <= set(ids) <= set(before)
            assert len(ids) == max(outside.sum(), LEAST_ATTACHED)
    for bone, ids in found["far"].attachments.items():
        np.testing.assert_array_equal(ids, bodies["far"].attachments[bone])


def test_a_bone_goes_on_holding_a_muscle_that_is_inside_another():
    """The three vertices that are least deep."""
    bodies = {"one": spindle(), "same": spindle((0.2, 0.0, 0.0))}
    found = drop_contested(bodies)["one"].attachments["a"]
    depth = Distance(bodies["same"].surface).signed(bodies["one"].surface.vertices)[0]
    others = np.setdiff1d(bodies["one"].attachments["a"], found)
    assert len(found) >= LEAST_ATTACHED
    assert depth[found].min() >= depth[others].max()


def test_no_vertex_has_to_stay_attached():
    bodies = {"one": spindle(), "same": spindle((0.2, 0.0, 0.0))}
    body = drop_contested(bodies, least=0)["one"]
    surface = Distance(bodies["same"].surface)
    assert 0 < len(body.attached_vertices) < len(bodies["one"].attached_vertices)
    assert surface.signed(body.surface.vertices[body.attached_vertices])[0].min() > CLEAR


def test_a_muscle_without_neighbours_keeps_its_attachments():
    body = spindle()
    found = drop_contested({"alone": body})["alone"].attachments
    for bone, ids in body.attachments.items():
        np.testing.assert_array_equal(found[bone], ids)


def test_the_margin_grows_until_muscles_can_be_separated(monkeypatch):
    tried = []

    def hardly(surfaces, bones, attached):
        tried.append(sum(map(len, attached.values())))
        if len(tried) < 3:
            raise Inseparable("Separation of muscles", "one and two meet")
        return Separation(dict(surfaces), 1.0, 0.0, 0)

    monkeypatch.setattr(contested, "separate", hardly)
    bodies = {"one": spindle(), "two": spindle((1.0, 0.5, 1.0))}
    assert separate_posed(bodies, {}).penetration == 0.0
    assert tried[0] > tried[1] >= tried[2]


def test_what_cannot_be_parted_at_all_is_an_error(monkeypatch):
    def never(surfaces, bones, attached):
        raise Inseparable("Separation of muscles", "one and two meet")

    monkeypatch.setattr(contested, "separate", never)
    with pytest.raises(ConvergenceError, match="one and two meet"):
        separate_posed({"one": spindle()}, {})
