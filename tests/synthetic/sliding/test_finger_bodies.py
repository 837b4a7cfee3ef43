"""The finger's bodies at rest: apart, attached where they are to be, as large as the phantom's."""

import numpy as np
import pytest
import trimesh
from tests.synthetic.test_phantom_finger import intersects_itself

from handpipe.mesh.surfaces.surface import Surface, concatenate
from handpipe.synthetic.phantom.phantom_finger import finger
from handpipe.synthetic.sliding import finger_bodies, finger_poses, finger_subject


@pytest.fixture(scope="module")
def bodies():
    return finger_bodies.build()


def test_no_surface_cuts_another(bodies):
    surfaces = [bodies.anatomy.mesh.boundary(), *bodies.bones.values()]
    whole = concatenate(surfaces)
    assert not intersects_itself((whole.vertices, whole.triangles))


def test_bodies_are_as_large_as_the_phantoms(bodies):
    mesh, labels = bodies.anatomy.mesh, bodies.anatomy.labels
    for name, muscle in finger_bodies.muscles().items():
        found = mesh.volumes()[labels == bodies.anatomy.regions.index(name)].sum()
        known = trimesh.Trimesh(*muscle.surface(), process=False)
        # Half a gap less all around, and facets.
        assert known.volume - 0.3 * known.area < found < known.volume - 0.05 * known.area
    skin = trimesh.Trimesh(*finger().skin_surface, process=False)
    outer = finger_poses.body_of(bodies).outer
    thicker = Surface(bodies.anatomy.mesh.vertices, outer).volume() - skin.volume
    assert 0.8 < thicker / skin.area / finger_bodies.FAT < 1.1


def test_septa_hold_the_palmar_side_alone(bodies):
    x = bodies.anatomy.mesh.vertices
    for bone in ("proximal2", "middle2"):
        on_fat = bodies.anatomy.bones[bone]
        on_fat = on_fat[on_fat < bodies.anatomy.mesh.tets[bodies.anatomy.labels == 0].max() + 1]
        assert len(on_fat) > 3 and (x[on_fat, 2] < 0).all()


def test_smoothed_surfaces_are_a_linear_map_of_the_nodes(bodies):
    body = finger_poses.body_of(bodies)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    at_rest = finger_subject.skin_at_rest(body)
    moved = finger_subject.smooth(2.0 * body.rest @ turn.T, body.outer, finger_subject.SMOOTHINGS["skin"])
    assert np.array_equal(moved[1], at_rest[1])
    assert np.allclose(moved[0], 2.0 * at_rest[0] @ turn.T, atol=1e-9)
    assert len(finger_subject.nail_of(at_rest)) > 20
