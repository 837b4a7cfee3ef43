"""The knee's reference on a known motion; where the images are, the knee's bones from strokes."""

import numpy as np
import pytest
from benchmarks.scans.intensities import apart, bends, registered
from benchmarks.scans.knee import skin
from benchmarks.scans.knee_build import SETS, STRAIGHT, STROKES, Knee
from scipy import ndimage
from scipy.spatial.transform import Rotation

from handpipe.core import RigidTransform
from handpipe.core.configuration import load_dataset
from handpipe.imaging.segmentation import SegmentationSettings, painted, segment_bone
from handpipe.imaging.volumes import Volume, read_volume, without_shading
from handpipe.stages.images.prepare_image import build_scale

JOINT = {"femur": [(80, 14, 46), (84, 44, 44)], "tibia": [(80, 14, 36), (80, 40, 34)]}  # beside the joint
CARTILAGE = [(80, 14, 40), (85, 22, 41), (78, 40, 37)]


def test_the_reference_finds_a_known_motion() -> None:
    texture = ndimage.gaussian_filter(np.random.default_rng(0).normal(0, 1, (48, 40, 44)), 2.0)
    fixed = Volume((100 + 300 * texture).astype(np.float32), np.diag([0.5, 0.48, 0.5, 1.0]))
    rotation = Rotation.from_rotvec(np.radians([2.0, 9.0, -3.0])).as_matrix()
    middle = fixed.to_world(np.array([[24.0, 20.0, 22.0]]))[0]
    true = RigidTransform(rotation, middle - rotation @ middle + [0.6, -0.4, 0.5])
    places = fixed.to_world(np.indices(fixed.shape).reshape(3, -1).T)
    moving = fixed.like(fixed.sample(true.inverse()(places)).reshape(fixed.shape))
    region = np.zeros(fixed.shape, bool)
    region[14:34, 12:28, 12:32] = True
    found = registered(fixed, moving, region, bends(middle, np.array([0.0, 12.0]), [np.zeros(3)]))
    angle, distance = apart(found.motion, true, middle)
    assert angle < 0.2 and distance < 0.05 and found.correlation > 0.98


@pytest.mark.skipif(Knee.absent(), reason="the shared real MRI is not beside the checkout")
@pytest.mark.parametrize("bone", JOINT)
def test_bones_of_the_knee_reach_the_joint_from_either_strokes(bone) -> None:
    dataset = load_dataset("config/datasets/knee.yaml")
    image = dataset.anatomy / dataset.limb.volumes[STRAIGHT]
    acquired = read_volume(image)
    volume = without_shading(Volume(acquired.values, build_scale(dataset) @ acquired.affine))
    claims = []
    for name in SETS:
        seeds, _ = painted(STROKES / f"strokes-{name}.json", image, dataset.labels)
        seeds = seeds[::-1, ::-1]  # the file's first two axes run against RAS
        found = segment_bone(volume, seeds, dataset.labels[bone], SegmentationSettings.from_dataset(dataset))
        claimed = np.zeros(volume.shape, bool)
        claimed[found.slices] = found.probability > 0.5
        claims.append(claimed[::-1, ::-1])
        assert all(claims[-1][place] for place in JOINT[bone])
        assert not any(claims[-1][place] for place in CARTILAGE)
    both = 2 * (claims[0] & claims[1]).sum() / (claims[0].sum() + claims[1].sum())
    assert both > 0.94


@pytest.mark.slow
@pytest.mark.skipif(Knee.absent(), reason="the shared real MRI is not beside the checkout")
def test_the_bent_leg_is_nearer_to_its_image_than_the_straight_one(tmp_path) -> None:
    """From strokes to the simulated skin: nothing that is cut off by the image is refused or compared."""
    figures = {name: value for name, (value, _) in skin(Knee.build(tmp_path / "knee", SETS[0])).items()}
    assert figures["knee_skin_compared"] > 0.75
    assert figures["knee_skin_error_mean"] < 5.0 < figures["knee_skin_unbent_error_mean"]
