"""Landmarks: known places of a body's points, by label (Wang 2021 §5.1)."""

from dataclasses import replace

import numpy as np
import pytest

from handpipe.core.errors import InputError
from handpipe.core.rigid import RigidTransform
from handpipe.imaging.evidence.markers import read_landmarks, write_markers
from handpipe.shapes.observations.correspondence import fixed_markers
from handpipe.shapes.optimisation.fit import EmbeddedSurface, KnownPoints, fit_shape

from .shapes import spindle


def test_a_landmark_draws_its_point_to_its_place():
    body = spindle()
    top = int(np.argmax(body.surface.vertices[:, 2]))
    body = replace(body, landmarks={"top": top, "absent": 0})
    place = body.surface.vertices[top] + [0.0, 0.0, 0.8]
    known = body.landmarked({"top": place, "elsewhere": np.zeros(3)})
    still = dict.fromkeys(body.attachments, RigidTransform.identity())
    no_markers = fixed_markers(np.zeros((0, 3)))
    fit = fit_shape(
        EmbeddedSurface(body.mesh, body.surface, body.matrix),
        KnownPoints(body.attached(still), landmarks=known),
        no_markers,
    )
    missed = np.linalg.norm(body.surface_at(fit.vertices).vertices[top] - place)
    assert missed < 0.3


def test_without_common_labels_there_is_nothing_to_hold():
    assert spindle().landmarked({"top": np.zeros(3)}) is None


def test_landmarks_survive_the_artifact():
    body = replace(spindle(), landmarks={"top": 7})
    group = {}
    for key, value in body.to_group().items():  # as an artifact nests it
        *path, last = key.split("/")
        inner = group
        for part in path:
            inner = inner.setdefault(part, {})
        inner[last] = value
    assert type(body).from_group(group).landmarks == {"top": 7}


def test_a_label_that_stands_twice_is_refused(tmp_path):
    path = tmp_path / "m.mrk.json"
    write_markers(path, np.zeros((2, 3)), ["top", "top"])
    with pytest.raises(InputError, match=r"m\.mrk\.json: label: 'top' stands twice"):
        read_landmarks(path)
