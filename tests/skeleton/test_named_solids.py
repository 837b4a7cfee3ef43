"""Bones of a hand of other proportions, named by the shipped template: against the phantom's true marrow."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handpipe.core.configuration.config import load_dataset
from handpipe.imaging.evidence import MarrowEvidence
from handpipe.imaging.segmentation import propose_solids
from handpipe.imaging.volumes import Volume, pose_volume, read_labels
from handpipe.mesh.surfaces import read_surface
from handpipe.skeleton.localisation import TemplateHand, find_solids, name_solids
from handpipe.synthetic import generators
from handpipe.synthetic.phantom import phantom_hand, phantom_hand_bones

SHIPPED = Path(generators.__file__).parents[1] / "anatomy/shipped/hand/bones"
SIZE, SPREAD = 0.88, 0.06  # of the bones' lengths; logarithm of each length's own factor


def other_proportions(patch: pytest.MonkeyPatch) -> None:
    """A smaller hand whose bones have lengths and girths of their own."""
    random = np.random.default_rng(3)
    for segments in phantom_hand_bones.RAYS.values():
        for kind, segment in list(segments.items()):
            longer, wider = SIZE * np.exp(SPREAD * random.standard_normal(2) * (1, 0.5))
            new = replace(segment, length=segment.length * longer, girth=segment.girth * wider)
            patch.setitem(segments, kind, new)
    for ray, (origin, along, dorsal) in list(phantom_hand_bones.METACARPALS.items()):
        place = tuple(SIZE * np.array(origin))
        patch.setitem(phantom_hand_bones.METACARPALS, ray, (place, along, dorsal))


@pytest.fixture(scope="module")
def hand(tmp_path_factory):
    """Dataset, image in units of marrow, and true marrow."""
    found = load_dataset("config/datasets/phantom-hand.yaml")
    found = found.model_copy(update={"root": tmp_path_factory.mktemp("hand"), "seed": 3})
    with pytest.MonkeyPatch.context() as patch:
        other_proportions(patch)
        phantom_hand.hand.cache_clear()
        generators.generator_of(found).generate_pose(found, "neutral")
        phantom_hand.hand.cache_clear()
    image = MarrowEvidence.measure(pose_volume(found, "neutral")).fine
    return found, image, read_labels(found.root / "truth/neutral.marrow.nii.gz", image)


@pytest.fixture(scope="module")
def template(hand) -> TemplateHand:
    dataset = hand[0]
    return TemplateHand.build(
        dataset, {bone: read_surface(SHIPPED / f"{bone}.ply", closed=True) for bone in dataset.bones}
    )


def share_right(solid, truth, label) -> float:
    return float((truth[tuple(solid.voxels.T)] == label).mean())


def wrong_and_sure(found, truth, labels) -> list[str]:
    return [n for n, b in found.items() if not b.marked and share_right(b.solid, truth, labels[n]) < 0.8]


def test_bones_of_a_hand_of_other_proportions_are_named(hand, template) -> None:
    """However the hand lies in the scanner."""
    dataset, image, truth = hand
    turned = np.eye(4)
    turned[:3, :3] = Rotation.from_rotvec([0.9, -1.7, 0.4]).as_matrix()
    found = name_solids(template, find_solids(Volume(image.values, turned @ image.affine)))
    assert wrong_and_sure(found, truth, dataset.labels) == []
    assert sum(not bone.marked for bone in found.values()) >= 21
    sure = {dataset.labels[n]: b.solid.voxels for n, b in found.items() if not b.marked}
    seeds = propose_solids(image, sure)
    for label in sure:
        assert (truth[seeds == label] == label).mean() > 0.95
    whole = read_labels(dataset.root / "truth/neutral.bones.nii.gz", image)
    assert (whole[seeds == 255] > 0).mean() < 0.02


def test_a_hand_of_the_other_side_is_not_named(hand, template) -> None:
    dataset, image, truth = hand
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    found = name_solids(template, find_solids(Volume(image.values, mirror @ image.affine)))
    assert wrong_and_sure(found, truth, dataset.labels) == []


def test_bones_that_the_image_lacks_are_marked(hand, template) -> None:
    dataset, image, truth = hand
    lost = ("middle3", "metacarpal5")
    dark = image.like(np.where(np.isin(truth, [dataset.labels[n] for n in lost]), 0.1, image.values))
    found = name_solids(template, find_solids(dark))
    assert all(found[bone].marked for bone in (*lost, "distal3"))
    assert wrong_and_sure(found, truth, dataset.labels) == []
    assert sum(not bone.marked for bone in found.values()) >= 16
