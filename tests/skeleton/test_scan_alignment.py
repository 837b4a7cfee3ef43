"""Scans displaced in known ways on a phantom finger, whose closed-form skin is not the alignment's model."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from benchmarks.scans.alignment import bent, displaced, finger_scan, settled
from scipy.spatial.transform import Rotation

from handpipe.core import InputError, RigidTransform
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.scan_alignment import smooth_offset
from handpipe.skeleton.scan_alignment.alignment import Alignment, align_scan
from handpipe.skeleton.scan_alignment.image_skin import ImageSkin, SkinHinge
from handpipe.skeleton.scan_alignment.refusal import limits_used, require_same_hand, require_same_size
from handpipe.skeleton.scan_alignment.smooth_offset import VOLUME
from handpipe.synthetic.geometry.kinematics import Posture
from handpipe.synthetic.phantom.phantom_finger import finger, posture

FILE = Path("scans/fist.ply")


def true_skin(pose: Posture) -> Surface:
    return Surface(*finger().posed(pose).skin)


@cache
def skin_of(pose: str, outwards: float = 0.0) -> ImageSkin:
    """The true skin of a pose, moved outwards by some mm, with the true bones and joints under it."""
    known = posture(pose, 1)
    posed, true = finger().posed(known), true_skin(known)
    target = true.moved(true.vertices + outwards * true.vertex_normals())
    names = list(posed.bones)
    hinges = []
    for joint in known.joints:
        carried = posed.transforms[joint.parent]
        ends = names.index(joint.parent), names.index(joint.child)
        hinges.append(SkinHinge(joint.name, carried(joint.centre), joint.axes @ carried.rotation.T, *ends))
    bones = {name: Surface(*posed.bones[name]) for name in names}
    return ImageSkin(target, np.ones(len(target.vertices), dtype=bool), bones, hinges)


def errors(found: Alignment, pose: str) -> np.ndarray:
    return Distance(true_skin(posture(pose, 1))).closest(found.surface.vertices)[0]


@pytest.mark.parametrize("pose", ["neutral", "fist"])
def test_displaced_scan_comes_back_onto_the_true_skin(pose):
    rng = np.random.default_rng(2)
    scan = displaced(finger_scan(settled(posture(pose, 1), rng), rng), rng)
    found = align_scan(scan, skin_of(pose))
    assert errors(found, pose).mean() < 0.04  # the scan's own noise is 0.024
    assert errors(found, pose).max() < 0.4
    require_same_hand(FILE, found)
    assert np.array_equal(found.surface.triangles, scan.triangles)


def test_the_rigid_motion_and_the_turn_of_a_joint_are_those_that_were_applied():
    rng = np.random.default_rng(3)
    scan = finger_scan(bent(posture("neutral", 1), {"PIP2_flexion": 3.0}), rng)
    turn = Rotation.from_rotvec([0.1, -0.15, 0.12]).as_matrix()
    motion = RigidTransform(turn, np.array([12.0, -9.0, 8.0]))
    found = align_scan(scan.moved(motion(scan.vertices)), skin_of("neutral"))
    off = found.motion @ motion
    assert np.degrees(off.angle_to(RigidTransform.identity())) < 0.3
    assert np.linalg.norm(off(np.zeros(3))) < 0.3
    assert found.joint_angles["PIP2"] == pytest.approx(3.0, abs=0.4)
    assert max(found.joint_angles["MP2"], found.joint_angles["DIP2"]) < 0.8


def test_a_scan_of_any_frame_that_faces_inwards_is_found():
    rng = np.random.default_rng(4)
    scan = finger_scan(posture("bow", 1), rng).flipped()
    far = RigidTransform(Rotation.from_rotvec([0.3, 2.6, -1.0]).as_matrix(), np.array([300.0, -80.0, 900.0]))
    found = align_scan(scan.moved(far(scan.vertices)), skin_of("bow"))
    assert errors(found, "bow").mean() < 0.04
    assert found.surface.volume() < 0


def test_detail_that_the_image_does_not_show_is_kept():
    """Ridges of 0.2 mm, 4 mm apart: the aligned scan has them where the image's skin is smooth."""
    rng = np.random.default_rng(5)
    plain = finger_scan(posture("neutral", 1), rng)
    ridges = 0.2 * np.sin(2 * np.pi * plain.vertices[:, 0] / 4.0)
    scan = plain.moved(plain.vertices + ridges[:, None] * plain.vertex_normals())
    found = align_scan(scan, skin_of("neutral"))
    signed = Distance(true_skin(posture("neutral", 1))).signed(found.surface.vertices)[0]
    middle = (plain.vertices[:, 0] > 10) & (plain.vertices[:, 0] < 140)
    kept = np.polyfit(ridges[middle], signed[middle], 1)[0]
    assert kept > 0.85


def test_a_field_on_a_coarser_copy_of_the_scan_is_that_on_the_scan_itself(monkeypatch):
    rng = np.random.default_rng(6)
    skin = skin_of("neutral")
    scan = finger_scan(posture("neutral", 1), rng)
    wave = 0.3 * np.sin(2 * np.pi * scan.vertices[:, 0] / 60.0)
    bulged = scan.moved(scan.vertices + wave[:, None] * scan.vertex_normals())
    found = {}
    for edge in (2.0, 0.1):
        monkeypatch.setattr(smooth_offset, "CARRIER", edge)
        found[edge] = smooth_offset.smooth_offset(bulged, skin, scan.volume()).vertices
    moved = np.linalg.norm(found[0.1] - bulged.vertices, axis=1)
    away = np.linalg.norm(found[2.0] - found[0.1], axis=1)
    assert moved.mean() > 0.1
    assert away.mean() < 0.01
    assert np.quantile(away, 0.99) < 0.05


def test_the_volume_of_the_scan_is_kept_where_the_skin_of_the_image_is_too_large():
    rng = np.random.default_rng(6)
    scan = finger_scan(posture("neutral", 1), rng)
    found = align_scan(scan, skin_of("neutral", 0.2))
    assert found.surface.volume() / scan.volume() == pytest.approx(1.0, abs=1.1 * VOLUME)
    assert 0.95 < found.volume_ratio < 0.98  # the image's skin has 4 % more
    assert errors(found, "neutral").mean() < 0.1


def test_places_where_the_image_cuts_the_body_do_not_attract_the_scan():
    """The image ends at x = 30; the scan goes on."""
    whole = skin_of("neutral")
    vertices = whole.surface.vertices.copy()
    cut = vertices[:, 0] < 30.0
    vertices[cut, 0] = 30.0
    short = replace(whole, surface=whole.surface.moved(vertices), trusted=~cut)
    rng = np.random.default_rng(7)
    scan = displaced(finger_scan(settled(posture("neutral", 1), rng), rng), rng)
    found = align_scan(scan, short)
    imaged = found.surface.vertices[:, 0] > 32.0
    assert errors(found, "neutral")[imaged].mean() < 0.05
    assert errors(found, "neutral").max() < 3.0  # 35 mm of scan beyond 20 mm of metacarpal in the image
    require_same_hand(FILE, found)


@pytest.mark.parametrize("angle", ["MP2_flexion", "PIP2_flexion"])
def test_a_finger_bent_by_forty_degrees_is_refused(angle):
    rng = np.random.default_rng(8)
    scan = displaced(finger_scan(bent(posture("neutral", 1), {angle: 40.0}), rng), rng)
    with pytest.raises(
        InputError, match=r"scans/fist\.ply: (pose|fit): .*Give the scan of this hand in this pose"
    ):
        require_same_hand(FILE, align_scan(scan, skin_of("neutral")))


@pytest.mark.parametrize("size", [0.92, 1.08])
def test_another_size_of_hand_is_refused(size):
    rng = np.random.default_rng(9)
    scan = finger_scan(posture("bow", 1), rng)
    found = align_scan(displaced(scan.moved(size * scan.vertices), rng), skin_of("bow"))
    assert max(limits_used(found).values()) > 1.3
    with pytest.raises(InputError, match=r"scans/fist\.ply: (fit|volume|pose): "):
        require_same_hand(FILE, found)


def figures(**changed: object) -> Alignment:
    plain = Alignment(
        Surface(np.zeros((3, 3)), np.array([[0, 1, 2]])),
        RigidTransform.identity(),
        {"MP2": 2.0, "PIP2": 3.0},
        0.1,
        0.01,
        {"proximal2": 0.0, "distal2": 0.02},
        1.01,
        0.05,
    )
    return replace(plain, **changed)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"residual": 0.8}, "fit: .*0.80 mm off on average"),
        ({"joint_angles": {"MP2": 9.0, "PIP2": 12.4}}, "pose: .*PIP2 turned by 12.4 deg"),
        ({"off": 0.1}, "fit: .*10 % of its area"),
        ({"off_parts": {"proximal2": 0.0, "distal2": 0.9}}, "fit: .*90 % of that at distal2"),
        ({"volume_ratio": 1.09}, "volume: .*1.09 times its volume"),
    ],
)
def test_the_message_names_what_was_measured(changed, said):
    require_same_hand(FILE, figures())
    with pytest.raises(InputError, match=said):
        require_same_hand(FILE, figures(**changed))


def test_a_scan_in_centimetres_is_named_before_it_is_aligned():
    true = true_skin(posture("neutral", 1))
    require_same_size(FILE, true, true)
    with pytest.raises(InputError, match="size: .*centimetres: scale by 10"):
        require_same_size(FILE, true.moved(0.1 * true.vertices), true)


def test_skin_follows_its_own_finger_where_the_next_one_is_nearer():
    """Two straight fingers 17 mm apart: between them both bones are near, one of them lies outwards."""
    ring = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    x = np.linspace(0.0, 40.0, 41)

    def tube(y: float, radius: float) -> Surface:
        points = np.stack(
            [
                np.repeat(x, 24),
                y + radius * np.tile(np.cos(ring), 41),
                radius * np.tile(np.sin(ring), 41),
            ],
            axis=1,
        )
        at = np.arange(40 * 24).reshape(40, 24)
        beside = np.roll(at, -1, axis=1)
        quads = np.stack([at, beside, beside + 24, at + 24], axis=-1).reshape(-1, 4)
        found = Surface(points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
        return (
            found
            if found.triangle_normals()[0] @ (found.vertices[0] - [0.0, y, 0.0]) > 0
            else found.flipped()
        )

    # The bones lie towards each other: 6 mm from the next finger's skin, 10 mm from the own one's far side.
    skin, bones = tube(0.0, 8.0), {"own": tube(-3.0, 2.0), "next": tube(13.0, 2.0)}
    image = ImageSkin(skin, np.ones(len(skin.vertices), dtype=bool), bones, [])
    towards = skin.vertices[:, 1] > 7.0
    nearer = np.linalg.norm(skin.vertices[towards, 1:] - [13.0, 0.0], axis=1) - 2.0
    assert nearer.max() < np.linalg.norm(skin.vertices[towards, 1:] - [-3.0, 0.0], axis=1).min() - 2.0
    assert image.weights[towards, 0].min() > 0.8
