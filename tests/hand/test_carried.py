"""Axis hints, tendons' paths and nails of the shipped hand, carried onto bones of a known other shape."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handpipe.anatomy.shipped import install
from handpipe.core.configuration import Dataset
from handpipe.hand.carried import CarriedTemplate, with_carried_hints
from handpipe.imaging.evidence import read_markers
from handpipe.mesh.files import read_surface
from handpipe.tissues.muscles.fitting import Rival

BONES = ("metacarpal2", "proximal2", "middle2", "distal2", "metacarpal3", "capitate")
TURN = Rotation.from_euler("zyx", [35.0, -20.0, 10.0], degrees=True).as_matrix()
SIZE = np.array([1.08, 0.94, 1.03])
SHIFT = np.array([40.0, -12.0, 90.0])


def other(points):
    """A longer, narrower hand whose fingers are bent a little, in another place."""
    x, y, z = (points * SIZE).T
    bend = 1.5e-3
    return np.column_stack([x, y, z - bend * np.maximum(x, 0.0) ** 2]) @ TURN.T + SHIFT


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Dataset:
    """The index finger of the shipped hand."""
    folder = tmp_path_factory.mktemp("hand")
    fields = install(folder)
    bones = {name: fields["bones"][name] for name in BONES}
    joints = {n: j for n, j in fields["joints"].items() if {j["parent"], j["child"]} <= set(BONES)}
    return Dataset(
        name="finger",
        root=folder,
        poses={"neutral": {"role": "neutral", "volume": "v.nii", "seeds": "s.nii"}},
        bones=bones,
        joints=joints,
        tendons={n: t for n, t in fields["tendons"].items() if set(t["bones"]) <= set(BONES)},
        nails={"nail2": fields["nails"]["nail2"]},
        drawn_in="template",
    )


@pytest.fixture(scope="module")
def carried(dataset: Dataset) -> CarriedTemplate:
    surfaces = {name: read_surface(dataset.path(bone.template)) for name, bone in dataset.bones.items()}
    return CarriedTemplate.onto(dataset, {n: s.moved(other(s.vertices)) for n, s in surfaces.items()})


def test_tendons_and_nails_are_where_the_other_hand_has_them(
    dataset: Dataset, carried: CarriedTemplate
) -> None:
    assert set(carried.paths) == {"flexor2", "extensor2"}
    for name, path in carried.paths.items():
        true = other(read_markers(dataset.path(dataset.tendons[name].path))[0])
        errors = np.linalg.norm(path - true, axis=1)
        assert errors[:-1].max() < 0.8 and errors.mean() < 0.4  # the last point is beyond all bones
    nail = read_surface(dataset.path(dataset.nails["nail2"].surface))
    errors = np.linalg.norm(carried.nails["nail2"].vertices - other(nail.vertices), axis=1)
    assert errors.mean() < 0.6 and errors.max() < 1.5
    np.testing.assert_array_equal(carried.nails["nail2"].triangles, nail.triangles)


def test_axes_turn_as_the_hand_does(dataset: Dataset, carried: CarriedTemplate) -> None:
    for name, joint in dataset.joints.items():
        if not joint.angles:
            continue
        template = read_surface(dataset.path(dataset.bones[joint.parent].template)).vertices
        bent = np.arctan(3e-3 * max(1.08 * template[:, 0].mean(), 0.0))  # slope of the bend at the parent
        turn = TURN @ Rotation.from_euler("y", bent).as_matrix()
        true = np.array(joint.axis_hints) @ turn.T
        cosines = (carried.axis_hints[name] * true).sum(axis=1) / np.linalg.norm(true, axis=1)
        assert np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0))).max() < 6.0


def test_stages_get_the_hints_in_the_neutral_frame(
    dataset: Dataset, carried: CarriedTemplate, tmp_path: Path
) -> None:
    carried.save(tmp_path / "carried.h5", [])
    placed = with_carried_hints(dataset, tmp_path / "carried.h5")
    for name, joint in placed.joints.items():
        np.testing.assert_array_equal(np.reshape(joint.axis_hints, (-1, 3)), carried.axis_hints[name])
        assert joint.limits_deg == dataset.joints[name].limits_deg
    assert with_carried_hints(dataset, None) is dataset
    again = CarriedTemplate.load(tmp_path / "carried.h5")
    np.testing.assert_array_equal(again.paths["flexor2"], carried.paths["flexor2"])
    np.testing.assert_array_equal(again.nails["nail2"].vertices, carried.nails["nail2"].vertices)
    assert again.rival is None and again.figures() == {}


def test_the_map_is_the_same_after_it_is_read(
    dataset: Dataset, carried: CarriedTemplate, tmp_path: Path
) -> None:
    """So that muscles are placed by it to the last bit as by a map that is made anew."""
    carried.save(tmp_path / "carried.h5", [])
    curve = read_markers(dataset.path(dataset.tendons["flexor2"].path))[0]
    np.testing.assert_array_equal(
        CarriedTemplate.load(tmp_path / "carried.h5").warp()(curve), carried.paths["flexor2"]
    )


def test_a_place_that_fits_nearly_as_well_is_kept_and_measured(
    carried: CarriedTemplate, tmp_path: Path
) -> None:
    replace(carried, rival=Rival(0.31, 0.35, 168.0)).save(tmp_path / "carried.h5", [])
    assert CarriedTemplate.load(tmp_path / "carried.h5").figures() == {
        "template_error": (0.31, "mm"),
        "template_error_turned": (0.35, "mm"),
        "template_turn": (168.0, "deg"),
    }
