import numpy as np
import pytest
from manufactured import bone, turn, unit

from handpipe.core.errors import ConvergenceError
from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.registration.doubts import loose_turns, odd_residuals
from handpipe.skeleton.registration.normal_equations import Rows, covariance
from handpipe.skeleton.registration.registration import _finish, _Pair, register
from handpipe.skeleton.registration.starts import principal_starts, uniform_starts

NEUTRAL = bone(60, 48)
TRUTH = RigidTransform(turn(np.radians(100) * unit([0.3, 0.9, -0.2])), np.array([31.0, -12.0, 55.0]))


def rotation_error(found, truth):
    return np.degrees(found.transform.angle_to(truth))


def centre_error(found, truth):
    middle = NEUTRAL.vertices.mean(axis=0)
    return np.linalg.norm(found.transform(middle) - truth(middle))


@pytest.mark.parametrize("roll", [0.0, 90.0, 180.0, 270.0])
def test_large_rotations_between_different_meshes(roll):
    target = bone(43, 61, stretch=1.4, seed=1)
    truth = TRUTH @ RigidTransform(turn(np.radians([roll, 0, 0])), np.zeros(3))
    found = register(NEUTRAL, target.moved(truth(target.vertices)))
    assert rotation_error(found, truth) < 0.1
    assert centre_error(found, truth) < 0.02


def test_noise_and_its_covariance():
    target = bone(40, 44, stretch=1.2)
    errors, deviations = [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        points = TRUTH(target.vertices) + 0.15 * rng.normal(size=target.vertices.shape)
        found = register(NEUTRAL, target.moved(points), start=TRUTH)
        back = RigidTransform(found.transform.rotation, np.zeros(3)).inverse()
        turned = RigidTransform(TRUTH.rotation @ back.rotation, np.zeros(3)).rotation_vector()
        middle = NEUTRAL.vertices.mean(axis=0)
        errors.append(np.concatenate([turned, TRUTH(middle) - found.transform(middle)]))
        deviations.append(np.linalg.cholesky(found.covariance))
    # Whitened by the estimated covariance, errors are of unit size: 36 numbers, within a factor 1.5.
    white = np.array([np.linalg.solve(c, e) for c, e in zip(deviations, errors, strict=True)])
    assert 0.65 < np.sqrt((white**2).mean()) < 1.5
    long_axis = TRUTH.rotation[:, 0]
    rolls = [np.sqrt(long_axis @ (c @ c.T)[:3, :3] @ long_axis) for c in deviations]
    tilts = [np.sqrt(np.linalg.eigvalsh((c @ c.T)[:3, :3])[0]) for c in deviations]
    assert np.mean(rolls) > 2 * np.mean(tilts)  # the rotation about the long axis is the uncertain one


def test_a_target_that_lacks_its_base():
    target = bone(70, 50, stretch=1.3)
    centres = target.vertices[target.triangles].mean(axis=1)
    part = Surface(target.vertices, target.triangles[centres[:, 0] > -9]).compact()
    found = register(NEUTRAL, part.moved(TRUTH(part.vertices)))
    assert rotation_error(found, TRUTH) < 0.15
    assert centre_error(found, TRUTH) < 0.05


def test_a_leak_of_the_segmentation_is_ignored():
    target = bone(60, 50, stretch=1.3, seed=2)
    vertices = target.vertices.copy()
    leak = np.linalg.norm(vertices - vertices[np.argmax(vertices[:, 2])], axis=1) < 3
    vertices[leak] += [0, 0, 2.5]
    found = register(NEUTRAL, target.moved(TRUTH(vertices)))
    assert rotation_error(found, TRUTH) < 0.2
    assert centre_error(found, TRUTH) < 0.05


@pytest.mark.parametrize("degrees", [90.0, 120.0])
def test_a_bone_without_a_long_axis_far_from_neutral(degrees):
    """As a carpal: a lump whose principal axes tell nothing; noise as of an image."""
    rng = np.random.default_rng(int(degrees))
    squat = NEUTRAL.moved(NEUTRAL.vertices * [0.36, 1.2, 1.3])
    target = bone(43, 61, stretch=1.4, seed=1)
    truth = RigidTransform.about(np.array([9.0, 4, 2]), turn(np.radians(degrees) * unit([0.5, -0.4, 0.7])))
    points = truth(target.vertices * [0.36, 1.2, 1.3]) + 0.05 * rng.normal(size=target.vertices.shape)
    found = register(squat, target.moved(points))
    assert rotation_error(found, truth) < 0.5
    assert not found.doubt


@pytest.mark.parametrize("cap", [False, True])
def test_half_of_a_bone(cap):
    """The image ends amid the bone: what is segmented is closed by a flat cap that no bone has."""
    target = cut(bone(70, 50, stretch=1.3), 0.0, cap)
    found = register(NEUTRAL, target.moved(TRUTH(target.vertices)))
    assert rotation_error(found, TRUTH) < 0.3
    assert centre_error(found, TRUTH) < 0.1
    assert not found.doubt
    assert 0.4 < found.covered < 0.6


def cut(surface, x, cap):
    """What lies beyond x; a cap joins the rim to its middle by rings of triangles."""
    beyond = surface.vertices[surface.triangles].mean(axis=1)[:, 0] > x
    part = Surface(surface.vertices, surface.triangles[beyond]).compact()
    edges, vertices, triangles = part.boundary_edges(), [part.vertices], [part.triangles]
    rim = np.unique(edges)
    middle, count, inner = part.vertices[rim].mean(axis=0), len(part.vertices), np.searchsorted(rim, edges)
    before = rim
    for share in np.linspace(0, 1, 7)[1:] if cap else ():
        ring = count + np.arange(len(rim))
        vertices.append((1 - share) * part.vertices[rim] + share * middle)
        a, b, c, d = before[inner[:, 0]], before[inner[:, 1]], ring[inner[:, 1]], ring[inner[:, 0]]
        triangles += [np.stack([a, b, c], 1), np.stack([a, c, d], 1)]
        before, count = ring, count + len(rim)
    return Surface(np.vstack(vertices), np.vstack(triangles))


def test_two_bones_in_one_segment():
    """A joint's bones have grown together in the image: the neutral bone is found in what is there."""
    own = bone(70, 50, stretch=1.3)
    bent = RigidTransform(turn([0, 1.0, 0]), np.array([28.0, 0, -14]))(0.8 * own.vertices)
    both = Surface(
        np.vstack([own.vertices, bent]), np.vstack([own.triangles, own.triangles + len(own.vertices)])
    )
    found = register(NEUTRAL, both.moved(TRUTH(both.vertices)))
    assert rotation_error(found, TRUTH) < 0.1
    assert centre_error(found, TRUTH) < 0.05
    assert found.covered > 0.95 and found.explained < 0.75 and not found.doubt


@pytest.mark.parametrize("scale", [0.9, 1.1])
def test_another_bone_of_the_same_kind_leaves_an_odd_residual(scale):
    """A neighbour's phalanx is a little shorter or longer: the pose's other bones tell that it is odd."""
    target = bone(40, 44, stretch=1.2)
    noise = 0.05 * np.random.default_rng(0).normal(size=target.vertices.shape)
    own = register(NEUTRAL, target.moved(TRUTH(target.vertices) + noise), start=TRUTH)
    wrong = register(NEUTRAL, target.moved(TRUTH(scale * target.vertices) + noise), start=TRUTH)
    found = odd_residuals({"a": own, "b": own, "c": wrong})
    assert list(found) == ["c"] or wrong.doubt


def test_a_bone_that_fits_turned_is_doubted():
    """Half a turn about the long axis changes nothing but a trace, less than the noise."""
    rng = np.random.default_rng(3)
    x, y, z = NEUTRAL.vertices.T
    across = np.hypot(y, z / 0.85)
    angle = np.arctan2(z / 0.85, y)
    radius = (4.2 + 1.2 * (x / 18) ** 2) * np.sqrt(np.maximum(1 - (x / 18) ** 2, 0)) ** 0.6
    assert np.corrcoef(across, radius)[0, 1] > 0.9  # the same bone without its condyles
    radius = radius * (1 + 0.15 * np.cos(2 * angle) + 0.001 * np.cos(angle))
    even = NEUTRAL.moved(np.column_stack([x + 0.01 * x**2, radius * np.cos(angle), radius * np.sin(angle)]))
    noisy = TRUTH(even.vertices) + 0.1 * rng.normal(size=even.vertices.shape)
    found = register(even, even.moved(noisy))
    assert "turned by 1" in found.doubt
    assert rotation_error(found, TRUTH) < 2 or abs(rotation_error(found, TRUTH) - 180) < 2
    assert register(even, even.moved(noisy), choose=lambda places: None).doubt == found.doubt
    told = register(even, even.moved(noisy), choose=lambda places: int(np.argmin(errors_of(places))))
    assert rotation_error(told, TRUTH) < 2 and not told.doubt
    other = register(even, even.moved(noisy), choose=lambda places: int(np.argmax(errors_of(places))))
    assert abs(rotation_error(other, TRUTH) - 180) < 2


def errors_of(places):
    return [rotation_error(place, TRUTH) for place in places]


def of_revolution(count, around, seed):
    """A bone without condyles, which looks the same turned about its long axis."""
    x, y, z = bone(count, around, seed=seed).vertices.T
    angle = np.arctan2(z / 0.85, y)
    radius = (4.2 + 1.2 * (x / 18) ** 2) * np.sqrt(np.maximum(1 - (x / 18) ** 2, 0)) ** 0.6
    surface = bone(count, around)
    return surface.moved(np.column_stack([x, radius * np.cos(angle), radius * np.sin(angle)]))


@pytest.mark.parametrize("seed", range(3))
def test_a_solid_of_revolution_is_doubted_by_name(seed):
    """Nothing tells the turn about the long axis: facets of the mesh do not count as if they did."""
    target = of_revolution(43, 61, seed + 1)
    noise = 0.05 * np.random.default_rng(seed).normal(size=target.vertices.shape)
    found = register(of_revolution(60, 48, seed), target.moved(TRUTH(target.vertices) + noise))
    assert "turn" in (found.doubt or loose_turns({"a": found}, {"a": target})["a"])


def test_a_direction_that_no_row_tells_is_not_known():
    """Rows of a sphere about its centre: translations are told, turns are not."""
    points = np.random.default_rng(0).normal(size=(400, 3))
    normals = points / np.linalg.norm(points, axis=1, keepdims=True)
    distance = 0.05 * np.random.default_rng(1).normal(size=400)
    rows = Rows.build(5 * normals, normals, distance, np.zeros(3))
    edges = np.array([[i, i + 1] for i in range(0, 400, 2)])
    found = covariance(rows, np.ones(400), edges, 5 * normals)
    assert np.sqrt(np.diag(found)[:3]) == pytest.approx(1.0, rel=0.01)
    assert (np.sqrt(np.diag(found)[3:]) < 0.01).all()


def test_errors_that_whole_patches_share_are_covered():
    """Twelve regions of a surface, each moved as a whole along its normal: errors by deviations."""
    target = bone(40, 44, stretch=1.2)
    rng, ratios = np.random.default_rng(0), []
    normals = target.vertex_normals()
    for _ in range(8):
        centres = target.vertices[rng.choice(len(target.vertices), 12, replace=False)]
        region = np.linalg.norm(target.vertices[:, None] - centres, axis=2).argmin(axis=1)
        shift = 0.08 * rng.normal(size=12)[region] + 0.02 * rng.normal(size=len(region))
        moved = target.moved(TRUTH(target.vertices + shift[:, None] * normals))
        found = _finish(_Pair.build(NEUTRAL, moved), TRUTH)
        ratios.append(rotation_error(found, TRUTH) / found.rotation_deviation)
    assert max(ratios) < 2.2 and 0.5 < np.sqrt(np.mean(np.square(ratios))) < 1.2


def test_starts_of_all_directions():
    starts = uniform_starts(NEUTRAL, NEUTRAL)
    rng = np.random.default_rng(0)
    for vector in rng.normal(size=(50, 3)):
        truth = RigidTransform(turn(np.pi * rng.random() * unit(vector)), np.zeros(3))
        assert min(np.degrees(s.angle_to(truth)) for s in starts) < 46


def test_starts_hold_a_good_guess():
    target = bone(30, 30)
    truth = TRUTH
    starts = principal_starts(NEUTRAL, target.moved(truth(target.vertices)))
    assert min(np.degrees(s.angle_to(truth)) for s in starts) < 25


def test_another_shape_is_refused():
    other = bone(8, 10)
    ball = 30 * other.vertices / np.linalg.norm(other.vertices, axis=1)[:, None]
    with pytest.raises(ConvergenceError):
        register(NEUTRAL, other.moved(ball))
