"""Whether a scan lies in its volume's frame: a phantom finger's skin, displaced by known motions."""

from functools import cache

import numpy as np
import pytest
from benchmarks.scans.alignment import finger_scan
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

from handpipe.core import RigidTransform
from handpipe.imaging.volumes import Volume, rasterise
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.scan_alignment import place_of_scan
from handpipe.synthetic.phantom.phantom_finger import finger, posture


@cache
def image_of(pose: str) -> Volume:
    """The inside of the true skin, bright and noisy, with air around it."""
    true = Surface(*finger().posed(posture(pose, 1)).skin)
    lower, upper = true.vertices.min(axis=0) - 8.0, true.vertices.max(axis=0) + 8.0
    affine = np.eye(4)
    affine[:3, 3] = lower
    shape = np.ceil(upper - lower).astype(int)
    inside = rasterise(Volume(np.zeros(shape, np.float32), affine), {1: true})
    clean = 400.0 * gaussian_filter(inside.astype(float), 0.5)
    noise = np.random.default_rng(0).normal(0.0, 12.0, (2, *shape))
    return Volume(np.hypot(clean + noise[0], noise[1]).astype(np.float32), affine)


@cache
def scan_of(pose: str) -> Surface:
    return finger_scan(posture(pose, 1), np.random.default_rng(1))


def displaced(scan: Surface, shift: float, turn: float) -> Surface:
    """Turned by some degrees about an oblique axis through its middle, and moved obliquely by some mm."""
    axis, way = np.array([0.48, -0.6, 0.64]), np.array([-0.36, 0.48, 0.8])
    rotation = Rotation.from_rotvec(turn * axis, degrees=True).as_matrix()
    turned = RigidTransform.about(scan.vertices.mean(axis=0), rotation)(scan.vertices)
    return scan.moved(turned + shift * way)


@pytest.mark.parametrize("pose", ["neutral", "fist"])
def test_a_displaced_scan_is_found_with_its_motion(pose: str) -> None:
    place = place_of_scan(displaced(scan_of(pose), 20.0, 15.0), image_of(pose))
    assert place.own_frame
    assert place.shift == pytest.approx(20.0, abs=1.0) and place.turn == pytest.approx(15.0, abs=1.0)


def test_a_scan_in_place_is_not_moved() -> None:
    place = place_of_scan(scan_of("neutral"), image_of("neutral"))
    assert not place.own_frame and place.agreement == place.moved and place.shift == 0.0


@pytest.mark.parametrize(
    "wrong",
    [
        displaced(scan_of("fist"), 20.0, 15.0),  # of another pose
        displaced(scan_of("neutral").moved(0.1 * scan_of("neutral").vertices), 20.0, 15.0),  # in centimetres
    ],
    ids=["pose", "unit"],
)
def test_what_fits_nowhere_is_left_to_the_check(wrong: Surface) -> None:
    assert not place_of_scan(wrong, image_of("neutral")).own_frame
