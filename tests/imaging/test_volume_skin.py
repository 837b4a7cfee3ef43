"""Skin of a volume against bodies that are known as functions: error, closedness, handles, ends, contacts."""

from pathlib import Path

import numpy as np
import pytest
from skin_images import Body, ball, capsule, image, surface

from handpipe.core import InputError, RigidTransform
from handpipe.imaging.skin import PosedBones, VolumeSkin, skin_of_volume
from handpipe.imaging.volumes.volume import Volume, read_volume
from handpipe.mesh.contact import cuts_itself
from handpipe.mesh.surfaces import Distance, Surface

QUARTER = 0.25  # of a voxel
SPACINGS = [0.5, 1.0, (0.5, 0.5, 1.0)]
FOOT = sorted((Path(__file__).parents[3] / "shared/data/real_mri/foot_dixon").glob("*.nii.gz"))


def errors(skin: VolumeSkin, body: Body, spacing: object) -> np.ndarray:
    """Distances of the skin from a body, in the shortest voxel edges; without the flat ends."""
    return np.abs(body(skin.open.vertices)) / np.min(spacing)


@pytest.mark.parametrize("spacing", SPACINGS)
@pytest.mark.parametrize("noise", [0.0, 0.03, 0.05])
def test_ball_is_found_below_a_quarter_of_a_voxel(spacing: object, noise: float) -> None:
    body = ball(9.0)
    skin = skin_of_volume(image(body, ([-14] * 3, [14] * 3), spacing, noise=noise))
    found = errors(skin, body, spacing)
    assert found.mean() < QUARTER
    assert found.max() < 1.6
    assert abs(body(skin.closed.vertices).mean()) < 0.1 * np.min(spacing), "neither inside nor outside"
    assert skin.closed.is_closed() and skin.handles == 0 and skin.ends == 0
    assert skin.closed.volume() == pytest.approx(4 / 3 * np.pi * 9**3, rel=0.03)
    assert skin.sure > 0.8


@pytest.mark.parametrize("spacing", SPACINGS)
def test_limb_is_open_where_the_border_of_the_image_cuts_it(spacing: object) -> None:
    body = capsule([-40, 0, 0], [10, 1, 2], 7.5)
    volume = image(body, ([-20, -13, -12], [22, 14, 14]), spacing)
    skin = skin_of_volume(volume)
    assert skin.ends == 1 and skin.closed.is_closed() and skin.handles == 0
    assert errors(skin, body, spacing).mean() < QUARTER
    rim = skin.open.vertices[np.unique(skin.open.boundary_edges())]
    assert np.abs(rim[:, 0] - volume.affine[0, 3]).max() < 1.3 * np.max(spacing), "the rim is at the border"
    radius = np.linalg.norm(rim[:, 1:].mean(axis=0) - rim[:, 1:], axis=1)
    assert np.abs(radius - 7.5).max() < 1.0


def test_a_dark_canal_that_the_border_cuts_is_no_skin() -> None:
    body = capsule([-40, 0, 0], [10, 0, 0], 8.0)
    canal = capsule([-40, 0, 0], [0, 0, 0], 3.0)
    skin = skin_of_volume(image(body, ([-20, -13, -13], [22, 13, 13]), 0.8, [(canal, 0.03)]))
    assert skin.ends == 1 and skin.handles == 0
    assert body(skin.open.vertices).min() > -1.0


def test_bright_or_dark_tissue_under_the_skin_does_not_move_it() -> None:
    """Fat of twice the dermis's intensity, or of a third of it, two voxels deep."""
    body, under = ball(10.0), ball(8.4)
    box = ([-14] * 3, [14] * 3)
    for value in (1.2, 0.2):
        skin = skin_of_volume(image(body, box, 0.8, [(under, value)]))
        assert np.abs(body(skin.open.vertices)).mean() < QUARTER * 0.8
        assert abs(body(skin.open.vertices).mean()) < 0.2


def test_planes_of_zeros_at_the_border_were_not_measured() -> None:
    body = capsule([-40, 0, 0], [10, 0, 0], 8.0)
    volume = image(body, ([-20, -13, -13], [22, 13, 13]), 0.8)
    volume.values[:4] = 0.0
    skin = skin_of_volume(volume)
    assert skin.ends == 1
    assert skin.closed.vertices[:, 0].min() > volume.affine[0, 3] + 3.9 * 0.8


def test_ghosts_and_other_parts_are_not_in_the_skin() -> None:
    body, other = ball(9.0), capsule([0, 24, 0], [0, 26, 0], 5.0)
    volume = image(body, ([-14, -14, -14], [14, 34, 14]), 0.8, [(other, 0.6)], fall_off=0.0)
    volume.values[:] += 0.06 * np.roll(volume.values, 20, axis=0)
    skin = skin_of_volume(volume)
    assert skin.others == 1
    assert errors(skin, body, 0.8).mean() < QUARTER


def test_volumes_without_a_skin_are_refused() -> None:
    thick = image(ball(9.0), ([-14] * 3, [14] * 3), (1.0, 1.0, 6.0))
    with pytest.raises(InputError, match="6 mm apart"):
        skin_of_volume(thick)
    with pytest.raises(InputError, match="everywhere"):
        skin_of_volume(Volume(np.ones((20, 20, 20), np.float32), np.eye(4)))
    with pytest.raises(InputError, match="no (air|body)"):
        skin_of_volume(
            Volume(np.random.default_rng(0).uniform(90, 110, (30, 30, 30)).astype("f4"), np.eye(4))
        )


RADIUS, BONE = 7.0, 3.0
PARTS = {"metacarpal": (-46, -30), "proximal": (-24, -8), "distal": (-5, 10)}
JOINTS = [("palm", "metacarpal"), ("metacarpal", "proximal"), ("proximal", "distal")]
BOX = ([-42, -21, -12], [23, 21, 12])
WEB_ENDS = -13.0  # mm, where the fingers of the image are two


def finger(y: float, other: float) -> Body:
    """A finger along x at y, flattened where it meets one at another y."""
    whole, side = capsule([-40, y, 0], [12, y, 0], RADIUS), np.sign(other - y)
    return lambda x: np.maximum(whole(x), side * (x[..., 1] - (y + other) / 2))


def two_fingers(apart: float) -> tuple[Body, Body, Body]:
    """Two fingers whose axes are some mm apart, and both with a palm."""
    one, other = finger(-apart / 2, apart / 2), finger(apart / 2, -apart / 2)

    def all_of_it(x: np.ndarray) -> np.ndarray:
        palm = np.linalg.norm((x - [-34, 0, 0]) / [20, 17, 9], axis=-1) - 1
        return np.minimum(np.minimum(one(x), other(x)), 9 * palm)

    return one, other, all_of_it


def bones_of(apart: float) -> tuple[dict[str, Surface], list[tuple[Body, float]]]:
    """Surfaces of the bones, and how they look."""
    found, looks = {"palm": surface(ball(2.0), np.array([[-2.0] * 3, [2.0] * 3]))}, []
    found["palm"] = found["palm"].moved(found["palm"].vertices - [60, 0, 0])
    for digit, y in (("2", -apart / 2), ("3", apart / 2)):
        for name, (start, end) in PARTS.items():
            body = capsule([start, y, 0], [end, y, 0], BONE)
            corners = np.array([[start - BONE, y - BONE, -BONE], [end + BONE, y + BONE, BONE]])
            found[name + digit] = surface(body, corners)
            looks += [(body, 0.08), (capsule([start, y, 0], [end, y, 0], 2.2), 0.9)]
    return found, looks


def joints() -> list[tuple[str, str]]:
    return [(a if a == "palm" else a + d, b + d) for d in "23" for a, b in JOINTS]


def assert_parted(skin: VolumeSkin, apart: float, spacing: object) -> None:
    """Each finger's skin beyond the web is its own; nothing of the skin spans from one to the other."""
    one, other, _ = two_fingers(apart)
    beyond = (skin.open.vertices[:, 0] > WEB_ENDS)[skin.open.triangles].all(axis=1)
    parts = Surface(skin.open.vertices, skin.open.triangles[beyond]).compact().components()
    assert len(parts) == 2
    for body, part in zip((one, other), sorted(parts, key=lambda p: p.vertices[:, 1].mean()), strict=True):
        found = np.abs(body(part.vertices))
        assert found.mean() < QUARTER * np.min(spacing)
        contact = (np.abs(part.vertices[:, 1]) < 0.8 * np.max(spacing)) & (np.abs(part.vertices[:, 2]) < 1)
        assert contact.sum() > 10, "its skin at the contact is there"
        assert found[contact].max() < 0.8 * np.max(spacing)
    assert skin.closed.is_closed() and skin.handles == 0
    assert not cuts_itself(skin.open)


@pytest.mark.parametrize("spacing", [0.8, 1.0, (0.5, 0.5, 1.0)])
def test_fingers_that_touch_are_told_apart_by_their_bones(spacing: object) -> None:
    bones, looks = bones_of(13.6)
    volume = image(two_fingers(13.6)[2], BOX, spacing, looks, fall_off=0.3)
    skin = skin_of_volume(volume, PosedBones(bones, joints()))
    assert skin.contact_faces > 50 and skin.ends == 1
    assert_parted(skin, 13.6, spacing)
    with pytest.raises(AssertionError):
        assert_parted(skin_of_volume(volume), 13.6, spacing)


def test_a_dark_line_tells_where_the_border_is() -> None:
    """The bones of one finger are not in its middle: half-way between the bones is not where they touch."""
    bones, looks = bones_of(13.6)
    whole = two_fingers(13.6)[2]

    def line(x: np.ndarray) -> np.ndarray:
        return np.maximum(np.maximum(np.abs(x[..., 1]) - 0.5, -18 - x[..., 0]), whole(x))

    shifted = {n: s.moved(s.vertices + [0, 1.6 * n.endswith("3"), 0]) for n, s in bones.items()}
    volume = image(whole, BOX, 0.8, [(line, 0.15), *looks], fall_off=0.3)
    assert_parted(skin_of_volume(volume, PosedBones(shifted, joints())), 13.6, 0.8)


def test_the_neutral_skin_tells_contacts_from_webs() -> None:
    """Fingers that are apart in neutral touch in a pose: the web between them stays whole."""
    neutral_apart, apart = 17.5, 13.6
    bones, looks = bones_of(apart)
    volume = image(two_fingers(apart)[2], BOX, 0.8, looks, fall_off=0.3)
    one, other, whole = two_fingers(neutral_apart)
    corners = np.array([[-41.0, -20, -11], [20, 20, 11]])
    neutral = surface(whole, corners, 0.8)
    by = (neutral_apart - apart) / 2
    motions = {
        n: RigidTransform(np.eye(3), np.array([0, {"2": by, "3": -by}.get(n[-1], 0.0), 0])) for n in bones
    }
    skin = skin_of_volume(volume, PosedBones(bones, joints(), motions, neutral))
    assert skin.contact_faces > 50
    assert_parted(skin, apart, 0.8)
    web = np.abs(skin.open.vertices - [-22, 0, 0]).max(axis=1) < 3.0
    assert not web.any(), "nothing is cut where the fingers are one"


@pytest.mark.slow
@pytest.mark.skipif(not FOOT, reason="the shared real MRI is not beside the checkout")
def test_skin_of_a_real_foot_agrees_between_echoes() -> None:
    """Its forefoot, where dermis, bright fat and fat that cancels with water lie at the edge in turn."""
    skins = []
    for path in FOOT:
        volume = read_volume(path)
        skins.append(skin_of_volume(volume.crop(np.array([0, 90, 0]), np.array(volume.shape))))
    for skin in skins:
        assert skin.closed.is_closed() and skin.handles == 0 and skin.ends == 1
        for other in skins:
            assert Distance(other.closed).closest(skin.open.vertices)[0].mean() < 0.3
