import numpy as np
from manufactured import bone, noisy, turn, unit

from handpipe.core.rigid import RigidTransform
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces.distance import Distance
from handpipe.skeleton.bones.registration_result import Registration
from handpipe.skeleton.registration.edge_refinement import refine_to_edges, steepest_falls

NEUTRAL = bone(44, 40)
TRUTH = RigidTransform(turn(np.radians(70) * unit([0.2, 0.9, -0.4])), np.array([12.0, -7.0, 30.0]))
SPACING, SHELL = 0.7, 0.3


def image(seed=0):
    """Bright marrow in a dark shell: the bone's edge blurred, SHELL mm outside the surface, with noise."""
    reach = 22.0
    count = int(2 * reach / SPACING)
    affine = np.diag([SPACING, SPACING, SPACING, 1.0])
    affine[:3, 3] = TRUTH(np.zeros(3)) - reach
    grid = np.stack(np.meshgrid(*3 * [np.arange(count)], indexing="ij"), axis=-1).reshape(-1, 3)
    distance = Distance(NEUTRAL).signed(TRUTH.inverse()(grid * SPACING + affine[:3, 3]))[0]
    values = 100 / (1 + np.exp((distance - SHELL) / 0.25))
    values += 4 * np.random.default_rng(seed).normal(size=values.shape)
    return Volume(values.reshape(3 * [count]).astype(np.float32), affine)


def test_a_rough_registration_is_brought_to_the_edges():
    start = noisy(TRUTH, np.random.default_rng(5), 1.5, 0.3, at=np.zeros(3))
    found = refine_to_edges(NEUTRAL, image(), Registration(start, 0.3, np.eye(6)))
    assert np.degrees(start.angle_to(TRUTH)) > 1.0
    assert np.degrees(found.transform.angle_to(TRUTH)) < 0.8
    assert np.linalg.norm(found.transform(np.zeros(3)) - TRUTH(np.zeros(3))) < 0.03
    back = RigidTransform(TRUTH.rotation @ found.transform.rotation.T, np.zeros(3))
    middle = NEUTRAL.vertices.mean(axis=0)
    error = np.concatenate([back.rotation_vector(), TRUTH(middle) - found.transform(middle)])
    white = np.linalg.solve(np.linalg.cholesky(found.covariance), error)
    assert 0.3 < np.sqrt((white**2).mean()) < 2.5


def test_falls_are_found_between_the_samples():
    along = np.linspace(-10, 10, 81)
    values = np.broadcast_to(-np.tanh((along - 0.37) / 0.5), (4, 4, 81)).astype(np.float32)
    affine = np.diag([1.0, 1.0, 0.25, 1.0])
    affine[2, 3] = -10
    points = np.array([[1.5, 1.5, 0.0], [1.5, 1.5, 6.0]])
    offset, confidence = steepest_falls(
        Volume(values, affine), points, np.array([[0, 0, 1.0], [0, 0, 1.0]]), 1.2
    )
    assert abs(offset[0] - 0.37) < 0.03
    assert confidence[0] == 1.0 and confidence[1] < 0.01
