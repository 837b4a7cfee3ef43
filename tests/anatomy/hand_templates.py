"""Templates that the tests of this folder share."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from handpipe.anatomy.person.subject_template import SubjectTemplate, TemplateMuscle, TemplateTendon
from handpipe.core.configuration.dataset import load_dataset
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.synthetic.template_hands import hand_templates

CONFIG = Path(__file__).parents[2] / "config/datasets"


def anatomy_folder() -> Path:
    dataset = load_dataset(CONFIG / "zanatomy-bones.yaml")
    folder = (CONFIG.parents[1] / dataset.anatomy).resolve()
    if not folder.exists():
        pytest.skip("the source anatomy is not on this machine")
    return folder


@cache
def real_hands() -> tuple[SubjectTemplate, SubjectTemplate]:
    """MyoHand's and Z-Anatomy's templates; skips the test where they are not at hand."""
    folder = anatomy_folder()
    return hand_templates.myohand(folder), hand_templates.zanatomy(folder)


@cache
def phantom() -> SubjectTemplate:
    return hand_templates.phantom()


@cache
def furnished() -> SubjectTemplate:
    """The phantom with a muscle of one tet, a tendon, and a skin that is a box with a nail."""
    bare = phantom()
    corners = np.array([[60.0, 10, -12], [70, 10, -12], [60, 20, -12], [60, 10, -2]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    mesh = TetMesh(corners, np.array([[0, 1, 2, 3]]))
    fibre = np.array([[0.6, 0.8, 0.0]])
    muscle = TemplateMuscle(
        Surface(corners, faces),
        {"metacarpal2": np.array([0, 1])},
        {"belly": corners.mean(axis=0)},
        mesh,
        fibre,
    )
    path = np.column_stack([np.linspace(150.0, 10.0, 30), np.zeros(30), np.full(30, -9.0)])
    tendon = TemplateTendon(path, "distal3", ("distal3", "middle3"), 1.5)
    box = np.array([[x, y, z] for x in (-30.0, 200) for y in (-60.0, 90) for z in (-60.0, 30)])
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    skin = Surface(box, np.array([t for a, b, c, d in sides for t in ([a, b, c], [a, c, d])]))
    return SubjectTemplate(
        "right",
        bare.bones,
        bare.joints,
        {"interosseous": muscle},
        {"capsule": muscle},
        {"flexor3": tendon},
        skin,
        {"distal3": np.array([3, 4])},
        bare.feature_points,
    )
