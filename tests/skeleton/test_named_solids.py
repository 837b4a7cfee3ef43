"""Bones of a hand of other proportions, named by the shipped template: against the phantom's true marrow."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial.transform import Rotation

from handpipe.core.configuration.dataset import load_dataset
from handpipe.imaging.evidence import MarrowEvidence
from handpipe.imaging.segmentation import propose_solids
from handpipe.imaging.volumes import Volume, pose_volume, read_labels
from handpipe.mesh.files import read_surface
from handpipe.skeleton.localisation import BrightSolid, SolidShape, TemplateHand, find_solids, name_solids
from handpipe.skeleton.localisation.hand_layout import Placed, Similarity
from handpipe.skeleton.localisation.named_solids import ImageSolids, JointGap, Naming
from handpipe.synthetic import generators
from handpipe.synthetic.phantom import phantom_hand, phantom_hand_bones

SHIPPED = Path(generators.__file__).parents[1] / "anatomy/shipped/hand/bones"
SIZE, SPREAD = 0.88, 0.06  # of the bones' lengths; logarithm of each length's own factor

ASIDE = (0, 12, 0)  # voxels


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
    seeds = propose_solids(image, sure, complete=len(sure) == len(found))
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
    lost = ("middle3", "proximal5")
    dark = image.like(np.where(np.isin(truth, [dataset.labels[n] for n in lost]), 0.1, image.values))
    found = name_solids(template, find_solids(dark))
    assert all(found[bone].marked for bone in (*lost, "distal3"))
    assert wrong_and_sure(found, truth, dataset.labels) == []
    assert sum(not bone.marked for bone in found.values()) >= 16


def test_a_bone_with_a_rival_is_marked(hand, template) -> None:
    """A bright solid of a distal phalanx's shape beside it, in the same distance from the joint."""
    dataset, image, truth = hand
    voxels = np.argwhere(truth == dataset.labels["distal5"])
    twin = np.zeros(image.shape, bool)
    twin[tuple((voxels + np.array(ASIDE)).T)] = True
    values = np.where(ndimage.binary_dilation(twin, iterations=3) & (truth == 0), 0.1, image.values)
    found = name_solids(template, find_solids(image.like(np.where(twin, 1.0, values))))
    assert found["distal5"].marked and not found["middle5"].marked
    assert wrong_and_sure(found, truth, dataset.labels) == []


def rod(start: int, stop: int) -> BrightSolid:
    """Voxels of 1 mm along the first axis, 5 mm thick."""
    voxels = np.argwhere(np.ones((stop - start, 5, 5), bool)) + [start, 0, 0]
    return BrightSolid(voxels, SolidShape.fit(voxels.astype(float), len(voxels)), 1.0, voxels.astype(float))


@pytest.mark.parametrize(
    ("wholes", "parted"),
    [
        ([], False),
        ([rod(0, 31)], True),  # as long as the first bone
        ([rod(0, 55)], False),  # two bones that touch: as long as none
    ],
)
def test_parts_of_one_bone_are_not_two_bones(wholes: list[BrightSolid], parted: bool) -> None:
    shapes = {"proximal": rod(0, 30).shape, "middle": rod(30, 55).shape}
    hand = TemplateHand(shapes, [], [[JointGap("proximal", "middle", 1, 0, 0.0)]])
    solids = [rod(0, 18), rod(19, 31), rod(31, 55), *wholes]
    overlapping = np.array(
        [[bool(set(a.places[:, 0]) & set(b.places[:, 0])) for a in solids] for b in solids]
    )
    placed = Placed(Similarity(np.eye(3), 1.0, np.zeros(3)), 0.0, {})
    named = Naming({"proximal": 0, "middle": 1})
    found = ImageSolids(hand, solids, overlapping).parted(placed, named)
    assert found == ({"proximal": "middle", "middle": "proximal"} if parted else {})
