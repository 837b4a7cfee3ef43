import numpy as np
import pytest
from manufactured import turn

from handpipe.core import artifacts
from handpipe.core.rigid import RigidTransform
from handpipe.skeleton.posing.pose_space import (
    ALIKE,
    FARTHEST,
    PoseSpace,
    felt_vector,
    pose_vector,
    reference_bone,
)

PARENTS = {"proximal": "metacarpal", "middle": "proximal"}
BONES = ("metacarpal", "proximal", "middle")
KINDS = ["inverse-distance", "inverse-square", "rbf"]


def pose(flexion, abduction=0.0, bend=0.0, root=None):
    root = RigidTransform.identity() if root is None else root
    proximal = root @ RigidTransform(turn([0, flexion, abduction]), np.array([40.0, 0, 1]))
    return {
        "metacarpal": root,
        "proximal": proximal,
        "middle": proximal @ RigidTransform(turn([0, bend, 0]), np.ones(3)),
    }


EXAMPLES = {
    "neutral": pose(0),
    "bow": pose(1.2),
    "hook": pose(0.1, 0.05, 1.6),
    "fist": pose(1.4, 0.0, 1.7),
    "spread": pose(0.05, 0.35),
    "close": pose(0.3, -0.3, 0.2),
    "curl": pose(0.6, 0.0, 0.9),
}


def space(kind):
    return PoseSpace.build(BONES, PARENTS, EXAMPLES, kind)


@pytest.mark.parametrize("kind", KINDS)
def test_exact_at_the_examples_and_a_partition_of_unity(kind):
    s = space(kind)
    for i, bones in enumerate(EXAMPLES.values()):
        assert np.allclose(s.weights(bones), np.eye(len(EXAMPLES))[i], atol=1e-12)
        near = dict(bones, middle=bones["middle"] @ RigidTransform(turn([0, 1e-5, 0]), np.zeros(3)))
        assert np.allclose(s.weights(near), np.eye(len(EXAMPLES))[i], atol=1e-3)
    rng = np.random.default_rng(0)
    for _ in range(20):
        w = s.weights(pose(*rng.uniform(-0.2, 1.5, 3)))
        assert abs(w.sum() - 1) < 1e-9
        assert kind == "rbf" or (w > 0).all()


def test_exponential_weights_along_a_line_are_those_of_a_markov_process():
    """Known for correlation exp(-distance / length): the two neighbours count alone, by hyperbolic sines."""
    places = np.array([-0.4, 0.0, 0.9, 2.0])
    s = PoseSpace(("a", "b"), "a", places[:, None], tuple("pqrs"), "exponential")
    x = 0.35
    expected = np.sinh([(0.9 - x) / ALIKE, x / ALIKE]) / np.sinh(0.9 / ALIKE)
    np.testing.assert_allclose(s.weights_at(np.array([x])), [0, *expected, 0], atol=1e-12)
    np.testing.assert_allclose(s.weights_at(np.array([3.5])), [0, 0, 0, np.exp(-1.5 / ALIKE)], atol=1e-12)


def test_exponential_weights_are_exact_at_the_examples_and_none_far_from_all():
    s = space("exponential")
    for i, bones in enumerate(EXAMPLES.values()):
        np.testing.assert_allclose(s.weights(bones), np.eye(len(EXAMPLES))[i], atol=1e-12)
    away = np.full(s.examples.shape[1], 20.0)
    assert np.abs(s.weights_at(away)).max() < 1e-9


def test_exponential_weights_of_examples_that_coincide_are_shared():
    twice = PoseSpace("ab", "a", np.array([[0.0], [1.0], [1.0]]), ("rest", "one", "other"), "exponential")
    weights = twice.weights_at(np.array([0.8]))
    assert weights[1] == pytest.approx(weights[2])
    alone = PoseSpace("ab", "a", np.array([[0.0], [1.0]]), ("rest", "one"), "exponential")
    assert weights[1] + weights[2] == pytest.approx(alone.weights_at(np.array([0.8]))[1])


def test_inverse_distance_weights_are_equation_1():
    s = space("inverse-distance")
    bones = pose(0.7, 0.1, 0.4)
    a = s.vector(bones)
    phi = np.array([1 / np.sqrt(((a - b) ** 2).sum()) for b in s.examples])
    assert np.allclose(s.weights(bones), phi / phi.sum())


@pytest.mark.parametrize("kind", KINDS)
def test_a_common_motion_changes_nothing(kind):
    s = space(kind)
    root = RigidTransform(turn([0.7, -1.1, 0.3]), np.array([5.0, -20, 9]))
    assert np.allclose(s.weights(pose(0.7, 0.1, 0.4)), s.weights(pose(0.7, 0.1, 0.4, root)), atol=1e-12)


def test_the_reference_has_most_controlling_descendants():
    assert reference_bone(BONES, PARENTS) == "metacarpal"
    assert reference_bone(("middle", "proximal"), PARENTS) == "proximal"
    forked = {"a": "root", "b": "root", "c": "b"}
    assert reference_bone(("a", "c", "b"), forked) == "b"
    assert pose_vector(("proximal", "middle"), "proximal", pose(1.0, 0.2, 0.5)) == pytest.approx([0, 0.5, 0])


def test_rbf_reproduces_linear_functions_also_a_little_beyond_the_examples():
    rng = np.random.default_rng(1)
    examples = rng.normal(size=(9, 3))
    s = PoseSpace(("a", "b"), "a", examples, tuple("123456789"), "rbf")
    slope, offset = rng.normal(size=(3, 4)), rng.normal(size=4)
    for scale in (0.3, 1.2):
        at = scale * examples[0]
        assert np.allclose(s.weights_at(at) @ (examples @ slope + offset), at @ slope + offset, atol=1e-9)


def test_rbf_extrapolates_within_a_bound_without_a_jump():
    """The joints of a hand reach three times as far as examples that bend little."""
    little = {n: pose(*b) for n, b in {"neutral": (0.0,), "a": (0.4, 0.1, 0.1), "b": (0.1, 0.0, 0.6)}.items()}
    s = PoseSpace.build(BONES, PARENTS, {**little, "c": pose(0.3, -0.2, 0.3)}, "rbf")
    way = [s.weights(pose(1.5 * t, 0.3 * t, 1.4 * t)) for t in np.linspace(0.05, 1.0, 400)]
    sizes = np.abs(way).sum(axis=1)
    assert sizes[0] < 1.5 and 1.5 < sizes.max() <= FARTHEST + 1e-12
    assert np.allclose(np.sum(way, axis=1), 1.0)
    assert np.abs(np.diff(way, axis=0)).max() < 0.05
    assert s.extrapolates(pose(1.5, 0.3, 1.4)) and not s.extrapolates(pose(0.2, 0.0, 0.3))
    assert not any(s.extrapolates(example) for example in little.values())


@pytest.mark.parametrize("bend", [1.7, 1.8, 2.2])
def test_joints_that_bend_by_more_than_half_a_turn_together_count_as_bent(bend):
    s = space("rbf")
    assert s.vector(pose(1.5, 0.0, bend)) == pytest.approx([0.0, 1.5, 0.0, 0.0, 1.5 + bend, 0.0])
    fist = list(EXAMPLES).index("fist")
    assert s.weights(pose(1.5, 0.0, bend))[fist] > 0.5


def test_rotations_below_half_a_turn_keep_their_bits():
    s, rng = space("rbf"), np.random.default_rng(5)
    for angles in rng.uniform([-0.4, -0.3, -0.1], [1.5, 0.3, 1.5], size=(50, 3)):
        assert np.array_equal(s.vector(pose(*angles)), pose_vector(BONES, "metacarpal", pose(*angles)))


def test_one_bone_alone_has_no_rotation_to_tell():
    s = PoseSpace.build(["a"], {}, {"p": {"a": RigidTransform.identity()}}, "rbf")
    moved = {"a": RigidTransform(turn([0, 2.0, 0]), np.ones(3))}
    assert s.weights(moved) == pytest.approx([1.0]) and not s.extrapolates(moved)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_rbf_with_few_examples_stays_bounded(count):
    some = dict(list(EXAMPLES.items())[:count])
    s = PoseSpace.build(BONES, PARENTS, some, "rbf")
    rng = np.random.default_rng(2)
    for _ in range(20):
        w = s.weights(pose(*rng.uniform(-0.2, 1.5, 3)))
        assert abs(w.sum() - 1) < 1e-9 and np.abs(w).max() < 2.5


@pytest.mark.parametrize("kind", KINDS)
def test_examples_that_coincide_share(kind):
    twice = EXAMPLES | {"again": EXAMPLES["bow"]}
    s = PoseSpace.build(BONES, PARENTS, twice, kind)
    w = s.weights(pose(0.8, 0.1, 0.2))
    assert abs(w.sum() - 1) < 1e-9 and abs(w[1] - w[-1]) < 1e-9
    assert s.weights(EXAMPLES["bow"])[[1, -1]] == pytest.approx([0.5, 0.5])


def test_rbf_predicts_a_smooth_function_better_than_inverse_distance():
    rng = np.random.default_rng(3)
    unseen = [tuple(v) for v in rng.uniform([0, -0.2, 0], [1.3, 0.3, 1.6], size=(40, 3))]

    def truth(bones):
        a = pose_vector(BONES, "metacarpal", bones)
        return np.array([np.sin(a[1]), a[4] - 0.2 * a[1] ** 2, np.exp(0.3 * a[2])])

    values = np.array([truth(b) for b in EXAMPLES.values()])
    errors = {
        k: np.mean([np.abs(space(k).interpolate(values, pose(*u)) - truth(pose(*u))) for u in unseen])
        for k in KINDS
    }
    assert errors["rbf"] < 0.6 * errors["inverse-distance"]


def test_interpolated_values_and_round_trip(tmp_path):
    s = space("rbf")
    values = np.random.default_rng(0).normal(size=(len(EXAMPLES), 5, 6))
    assert np.allclose(s.interpolate(values, EXAMPLES["fist"]), values[3])
    artifacts.write(tmp_path / "s.h5", {"pose_space": s.to_group()}, kind="test")
    t = PoseSpace.from_group(artifacts.read(tmp_path / "s.h5", "test")["pose_space"])
    assert (t.bones, t.reference, t.poses, t.interpolation) == (
        s.bones,
        s.reference,
        s.poses,
        s.interpolation,
    )
    assert np.array_equal(t.weights(pose(0.3, 0.2, 0.1)), s.weights(pose(0.3, 0.2, 0.1)))


def test_unknown_interpolation_is_refused():
    with pytest.raises(ValueError, match="nearest"):
        PoseSpace(("a", "b"), "a", np.zeros((1, 3)), ("p",), "nearest")


POINTS = {"a": np.array([[0.0, 0, 0], [0, 2, 0]]), "b": np.array([[10.0, 0, 0], [10, 2, 0]])}


def turned(bone: str, angle: float, centre) -> dict[str, RigidTransform]:
    rotation = turn([0.0, 0.0, angle])
    still = {name: RigidTransform.identity() for name in POINTS}
    return still | {bone: RigidTransform(rotation, np.array(centre) - rotation @ centre)}


@pytest.mark.parametrize("lever", [2.0, 8.0])
def test_a_rotation_is_felt_by_its_lever(lever):
    """About (10 - lever, 1, 0) both points of b go on circles; all lie 26 ** 0.5 mm from their middle."""
    felt = felt_vector(POINTS, "a", turned("b", 0.3, [10.0 - lever, 1.0, 0.0]))
    arc = 2 * np.sin(0.15) * np.hypot(lever, 1.0)
    assert np.linalg.norm(felt) == pytest.approx(arc * np.sqrt(2 / 4) / np.sqrt(26.0))


def test_a_common_motion_is_not_felt():
    motion = RigidTransform(turn([0.4, -0.2, 0.9]), np.array([3.0, -7.0, 2.0]))
    bones = turned("b", 0.3, [4.0, 0.0, 0.0])
    assert felt_vector(POINTS, "a", {n: motion @ t for n, t in bones.items()}) == pytest.approx(
        felt_vector(POINTS, "a", bones)
    )


def test_a_felt_space_is_exact_at_its_examples_and_survives_its_artifact(tmp_path):
    poses = {str(i): turned("b", 0.3 * i, [4.0, 0.0, 0.0]) for i in range(4)}
    space = PoseSpace.build(["a", "b"], {"b": "a"}, poses, "rbf", POINTS)
    for i, bones in enumerate(poses.values()):
        assert space.weights(bones) == pytest.approx(np.eye(4)[i], abs=1e-6)
    artifacts.write(tmp_path / "s.h5", {"pose_space": space.to_group()}, kind="test")
    again = PoseSpace.from_group(artifacts.read(tmp_path / "s.h5", "test")["pose_space"])
    between = turned("b", 0.5, [4.0, 0.0, 0.0])
    assert again.weights(between) == pytest.approx(space.weights(between))
