"""A toy as a hand's template: what is skin, which muscles pull, and a bend with all of it."""

import numpy as np
import pytest
from benchmarks.truth import toy
from scipy.spatial.transform import Rotation

from handpipe.anatomy.person.subject_template import (
    SubjectTemplate,
    TemplateJoint,
    TemplateMuscle,
    TemplateTendon,
)
from handpipe.anatomy.templates.tissue_mesh import TissueMesh
from handpipe.core.rigid import RigidTransform
from handpipe.fem.solver.equilibrium import Options
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface
from handpipe.synthetic.continuum.surfaces import bone_faces, outer_faces
from handpipe.synthetic.coupled.follow import follow
from handpipe.synthetic.template_hands.hand_body import DEPTH, TENSION, HandBody, open_hand

BENT = np.radians(70.0)


def _template(anatomy):
    labels = (anatomy.labels == 2).astype(int)
    fibres = np.zeros((len(labels), 3))
    fibres[labels == 1] = anatomy.fibres["flexor"]
    outer = np.unique(outer_faces(anatomy.mesh, anatomy.bones.values()))
    return TissueMesh(anatomy.mesh, labels, ("fat", "flexor"), fibres, {}, {}, outer, dict(anatomy.bones))


def _subject(anatomy):
    mesh = anatomy.mesh
    bones = {n: Surface(mesh.vertices, bone_faces(mesh, on)).flipped() for n, on in anatomy.bones.items()}
    surface = Surface(np.array([[8.0, 0, -4], [32.0, 0, -1], [20.0, 3, -4]]), np.array([[0, 1, 2]]))
    joint = TemplateJoint("J", "proximal", "distal", ("J_flexion",), np.array([[0, 1.0, 0]]), toy.CENTRE)
    muscle = TemplateMuscle(surface, {"proximal": np.array([0]), "distal": np.array([1])})
    path = np.array([[30.0, 0, -2.5], [20.0, 0, -4.0], [10.0, 0, -6.5]])
    tendon = TemplateTendon(path, "distal", ("distal", "proximal"), 1.0)
    compact = {name: bone.compact() for name, bone in bones.items()}
    return SubjectTemplate("right", compact, (joint,), {"flexor": muscle}, tendons={"flexor": tendon})


def _bones(angle):
    turn = Rotation.from_rotvec([0, angle, 0]).as_matrix()
    return {"proximal": RigidTransform.identity(), "distal": RigidTransform.about(toy.CENTRE, turn)}


@pytest.fixture(scope="module")
def hand():
    anatomy = toy.finger(5.0)
    positions = [_bones(t * BENT) for t in np.linspace(0, 1, 5)]
    subject = _subject(anatomy)
    return HandBody.mesh(open_hand(_template(anatomy), subject, positions), subject, 1)


def test_skin_is_the_fat_next_to_the_surface(hand):
    anatomy = hand.body.anatomy
    outer = Surface(anatomy.mesh.vertices, hand.body.skin_faces).compact()
    middles = anatomy.mesh.vertices[anatomy.mesh.tets].mean(axis=1)
    depth = Distance(outer).closest(middles)[0]
    assert depth[anatomy.tets_of("skin")].max() < DEPTH < depth[anatomy.tets_of("fat")].min()
    assert outer.is_closed() and np.isclose(len(outer.components()), 1)


def test_a_muscle_pulls_as_it_gets_shorter(hand):
    """Its ends lie 8 to 15 mm from the axis: by the law of cosines of that triangle."""
    start, end = np.array([8.0, 0, -4]), np.array([32.0, 0, -1])
    a, b = start - toy.CENTRE, end - toy.CENTRE
    for angle in (-0.3, 0.0, 0.1, BENT):
        turned = b @ Rotation.from_rotvec([0, angle, 0]).as_matrix().T
        share = 1 - np.linalg.norm(turned - a) / np.linalg.norm(b - a)
        wanted = TENSION * np.clip(share / 0.15, 0, 1)
        assert hand.pose(_bones(angle)).tensions["flexor"] == pytest.approx(wanted, abs=1e-9)
    assert hand.pose(_bones(-0.3)).tensions["flexor"] == 0.0 < hand.pose(_bones(0.1)).tensions["flexor"]


def test_the_hand_bends_and_keeps_its_muscle(hand):
    options = Options(name="toy hand", max_iterations=60, untangle=False)
    found = follow(hand.body, lambda t: hand.pose(_bones(t * BENT)), steps=8, options=options)
    assert hand.body.inverted(found.x) == 0
    volume = hand.body.volume("flexor", found.x) / hand.body.volume("flexor", hand.body.rest)
    assert abs(volume - 1) < 0.05
