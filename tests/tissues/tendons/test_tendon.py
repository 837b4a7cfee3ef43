"""Hooks, the fitted tendon, its artifact and its layer."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from handpipe.core.arrays import Array
from handpipe.core.errors import ConvergenceError
from handpipe.core.layers import Frame, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.tissues.tendons.fitting.hooks import fit_weights
from handpipe.tissues.tendons.fitting.registration import centreline_errors
from handpipe.tissues.tendons.layer import TendonLayer
from handpipe.tissues.tendons.rods.energies import Bend, EndForce, Hooks
from handpipe.tissues.tendons.rods.equilibrium import RodOptions, solve
from handpipe.tissues.tendons.rods.rest import PULL
from handpipe.tissues.tendons.rods.rod import closest_on_rod, directions, frames, length_change
from handpipe.tissues.tendons.tendon import RegisteredRods, Tendon, build_tendon

from .finger import BONES, PARENTS, RADIUS, bone_surfaces, course, flexor, pose, rest_tendon, true_rod
from .flesh import PALM, WIDTH, pushed, pushed_rod

EXAMPLES = {"neutral": (0.0, 0.0), "bent": (1.2, 0.4), "hooked": (0.2, 1.1), "fist": (1.5, 1.0)}


@pytest.fixture(scope="module")
def tendon() -> Tendon:
    rest = rest_tendon()
    rods = {name: true_rod(rest, *angles) for name, angles in EXAMPLES.items()}
    poses = {name: pose(*angles) for name, angles in EXAMPLES.items()}
    return build_tendon("extensor", rest, RADIUS, bone_surfaces(), RegisteredRods(rods, poses, PARENTS))


def test_weights_of_known_skinning_are_recovered() -> None:
    """Rods that pass across each skinned point, so that the closest point fixes the weight."""
    known = np.array([0.8, 0.3])
    rest = np.array([[40.0, 0, 7], [20.0, 0, 7]])
    pair = np.array([[1, 0], [0, 1]])
    poses = [[pose(a, 0)["base"], pose(a, 0)["middle"]] for a in (0.4, 0.9, 1.3)]
    rods = []
    for transforms in poses:
        moved = np.stack([t(rest) for t in transforms])
        first, second = moved[pair[:, 0], [0, 1]], moved[pair[:, 1], [0, 1]]
        points = known[:, None] * first + (1 - known)[:, None] * second
        # a rod along y through each point, with a way round between them
        lines = [[p - [0, 30 * s, 0], p + [0, 30 * s, 0]] for p, s in zip(points, (1, -1), strict=True)]
        rods.append(np.vstack([*lines[0], *lines[1]]))
    found = fit_weights(rest, pair, np.ones(2), rods, poses)
    np.testing.assert_allclose(found, known, atol=1e-3)


def test_weights_are_convex_and_of_two_bones(tendon: Tendon) -> None:
    weights = tendon.hooks.weights
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    assert (weights >= 0).all() and ((weights > 0).sum(axis=1) <= 2).all()


@pytest.mark.parametrize("name", list(EXAMPLES))
def test_examples_are_met(tendon: Tendon, name: str) -> None:
    found = tendon.solve(pose(*EXAMPLES[name]))
    errors = np.concatenate(centreline_errors(found.x, course(*EXAMPLES[name])))
    # between hooks, the rod cuts the manufactured course's tight arcs of 7 mm radius
    assert errors.mean() < 0.1 and errors.max() < 1.5
    assert length_change(found.x, tendon.rest.length) < 1e-10


def test_corrections_are_exact_at_the_examples(tendon: Tendon) -> None:
    for n, angles in enumerate(EXAMPLES.values()):
        bones = pose(*angles)
        expected = tendon.hooks.carried(bones) + tendon.hooks.corrections[n]
        np.testing.assert_allclose(tendon.hook_positions(bones), expected, atol=1e-12)


def test_a_hook_follows_the_joints_next_to_it() -> None:
    """The example that bends the near joint moves the hooks at the base, whatever the far joint does."""
    rest = rest_tendon()
    angles = {"neutral": (0.0, 0.0), "tip": (0.0, 1.1), "base": (1.1, 0.0)}
    rods = {name: true_rod(rest, *a) for name, a in angles.items()}
    rods["base"] = rods["base"] + [0.0, 0.0, 0.5]
    examples = RegisteredRods(rods, {n: pose(*a) for n, a in angles.items()}, PARENTS)
    tendon = build_tendon("extensor", rest, RADIUS, bone_surfaces(), examples)
    at_base = rest.skinning[closest_on_rod(tendon.hooks.rest, rest.x)[0]][:, -1] > 0.999
    both, base = (
        tendon.hook_positions(p) - tendon.hooks.carried(p) for p in (pose(1.1, 1.1), pose(1.1, 0.0))
    )
    assert at_base.any()
    np.testing.assert_allclose(both[at_base], base[at_base], atol=1e-3)


def test_between_the_examples_it_slides_by_the_moment_arm(tendon: Tendon) -> None:
    """The free end of an extensor moves by depth times angle (a circle round each hinge)."""
    ends = [tendon.solve(pose(*angles)).x[-1, 0] for angles in ((0.0, 0.0), (0.7, 0.5))]
    assert ends[1] - ends[0] == pytest.approx(7.0 * 1.2, abs=0.6)


@pytest.mark.parametrize("angles", [(1.2, 0.4), (0.7, 0.5), (1.5, 1.0)])
def test_answer_does_not_depend_on_the_start(tendon: Tendon, angles: tuple[float, float]) -> None:
    bones = pose(*angles)
    usual = tendon.solve(bones).x
    other = tendon.solve(bones, start=tendon.rest.carried(bones)).x
    np.testing.assert_allclose(other, usual, atol=1e-4)


@pytest.fixture(scope="module", params=["few", "fist"])
def flexing(request: pytest.FixtureRequest) -> Tendon:
    """A flexor whose examples bend little, and one that has seen a fist."""
    return flexor({"few": {"neutral": (0.0, 0.0), "bent": (0.5, 0.3)}, "fist": EXAMPLES}[request.param])


def test_a_flexor_converges_from_extension_to_beyond_a_fist(flexing: Tendon) -> None:
    """Hooks before and behind a bent joint cross each other: the rod is folded there, and compressed."""
    for middle in np.radians([-30, 10, 50, 90, 110]):
        for distal in np.radians([-20, 10, 50, 80, 90]):
            bones = pose(middle, distal)
            found = flexing.solve(bones)
            assert length_change(found.x, flexing.rest.length) < 1e-10
            assert found.residual < 1e-5 and unbalanced(flexing, bones, found.x) < 1e-3


def unbalanced(tendon: Tendon, bones: dict[str, RigidTransform], x: Array) -> float:
    """Largest slope of the energy over turns of single segments, by finite differences, over the pull."""
    energies = tendon.energies(bones)
    for energy in energies:
        energy.refresh(x)
    d, length, random = directions(x), tendon.rest.length, np.random.default_rng(0)
    slopes = []
    for i in range(0, len(d), 3):
        across = np.cross(d[i], random.standard_normal(3))
        across /= np.linalg.norm(across)
        values = []
        for h in (-1e-4, 1e-4):
            moved = d.copy()
            moved[i] = np.cos(h) * d[i] + np.sin(h) * across
            trial = np.vstack([x[:1], x[0] + length * np.cumsum(moved, axis=0)])
            values.append(sum(energy.value(trial) for energy in energies))
        slopes.append((values[1] - values[0]) / 2e-4 / length)
    return float(np.abs(slopes).max()) / PULL


def test_a_wrapped_failure_says_its_remedy_once(tendon: Tendon, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "handpipe.tissues.tendons.tendon.solve", partial(solve, options=RodOptions(max_iterations=1))
    )
    with pytest.raises(ConvergenceError) as error:
        tendon.solve(pose(1.0, 0.7))
    said = str(error.value)
    assert said.startswith("Tendon extensor did not converge: the rod: unbalanced force")
    assert said.endswith("after 1 steps. See the log for its residuals.") and said.count("See the log") == 1


def test_common_motion_moves_the_answer(tendon: Tendon) -> None:
    bones = pose(0.7, 0.5)
    moved = pose(0.3, 0.2)["distal"]
    there = tendon.solve({name: moved @ t for name, t in bones.items()}).x
    np.testing.assert_allclose(there, moved(tendon.solve(bones).x), atol=1e-6)


def test_saved_and_loaded_it_is_the_same(tendon: Tendon, tmp_path: Path) -> None:
    tendon.save(tmp_path / "tendon.h5")
    loaded = Tendon.load(tmp_path / "tendon.h5")
    assert (loaded.name, loaded.radius, loaded.rest.bones) == ("extensor", RADIUS, BONES)
    bones = pose(0.7, 0.5)
    np.testing.assert_array_equal(loaded.solve(bones).x, tendon.solve(bones).x)


def test_layer_gives_tube_and_centreline(tendon: Tendon) -> None:
    bones = pose(1.2, 0.4)
    shapes = TendonLayer([tendon]).solve(Frame("bent", {}, bones), {})
    tube, line = shapes["extensor"], shapes["extensor_centreline"]
    assert tube.rest.shape == tube.vertices.shape and line.cells.shape == (len(line.vertices) - 1, 2)
    radius = closest_on_rod(tube.vertices[:-2], line.vertices)[2]
    np.testing.assert_allclose(radius, RADIUS, atol=0.2)
    assert line.fields["tension"].shape == (len(line.cells),)


def test_rest_surface_is_skinned_onto_itself(tendon: Tendon) -> None:
    rest = tendon.rest
    turned = pose(0.9, 0.0)["middle"]
    moved = rest.tube.skin(turned(rest.x), frames(turned(rest.x), turned.rotation @ rest.normal))
    np.testing.assert_allclose(moved, turned(rest.surface().vertices), atol=1e-10)


def test_a_free_rod_slides_through_its_own_hooks(tendon: Tendon) -> None:
    """Hooks at rest leave the rest rod at rest, but for the pull's small give."""
    x = tendon.rest.x
    found = solve(
        [Hooks(x[3:-3:3]), EndForce(0.5 * tendon.rest.pull_direction), Bend(1.0, tendon.rest.length)], x
    )
    np.testing.assert_allclose(found.x, x, atol=1e-6)


# --- hooks in the flesh

# mm sideways, by what is no bone of the tendon
PUSHES = {"neutral": 0.0, "bent": 0.0, "hooked": 3.0, "fist": 1.0}


def of_pushed(flesh: dict[str, Shape] | None) -> Tendon:
    """The tendon fitted to rods that are pushed in the examples, with flesh or without."""
    rest = rest_tendon()
    rods = {name: pushed_rod(rest, *angles, PUSHES[name]) for name, angles in EXAMPLES.items()}
    poses = {name: pose(*angles) for name, angles in EXAMPLES.items()}
    examples = RegisteredRods(rods, poses, PARENTS, flesh)
    return build_tendon("extensor", rest, RADIUS, bone_surfaces(), examples)


@pytest.fixture(scope="module")
def fleshed() -> Tendon:
    return of_pushed({name: pushed(*angles, PUSHES[name]) for name, angles in EXAMPLES.items()})


def test_flesh_that_is_pushed_pushes_the_tendon(fleshed: Tendon) -> None:
    """The bones that the tendon passes are where an example has them; what pushes is not one of them."""
    for push in (0.0, 4.0, -4.0):
        bones, truth = pose(1.2, 0.4), pushed_rod(fleshed.rest, 1.2, 0.4, push)
        found = fleshed.solve(bones, pushed(1.2, 0.4, push).vertices).x
        errors = np.concatenate(centreline_errors(found, truth))
        assert errors.mean() < 0.15 and errors.max() < 1.5
    errors = np.concatenate(centreline_errors(of_pushed(None).solve(bones).x, truth))
    assert errors.max() > 3.0  # hooks on bones do not know


@pytest.mark.parametrize("name", list(EXAMPLES))
def test_examples_are_met_in_the_flesh(fleshed: Tendon, name: str) -> None:
    angles, push = EXAMPLES[name], PUSHES[name]
    found = fleshed.solve(pose(*angles), pushed(*angles, push).vertices)
    errors = np.concatenate(centreline_errors(found.x, pushed_rod(fleshed.rest, *angles, push)))
    assert errors.mean() < 0.15 and errors.max() < 1.5  # those tight arcs again, as with hooks on bones


def test_the_flesh_carries_hooks_where_it_is_pushed_and_bones_the_others(fleshed: Tendon) -> None:
    x, chosen = fleshed.hooks.rest[:, 0], fleshed.hooks.in_flesh
    assert chosen is not None
    assert set(np.flatnonzero(np.abs(x - PALM) < WIDTH)) <= set(chosen.hooks)
    assert x[chosen.hooks].max() < 30.0  # the finger's flesh is up to 1 mm beside the tendon's arcs


def test_a_common_motion_of_bones_and_flesh_moves_the_answer(fleshed: Tendon) -> None:
    bones, flesh = pose(0.7, 0.5), pushed(0.7, 0.5, 2.0).vertices
    moved = pose(0.3, 0.2)["distal"]
    there = fleshed.solve({name: moved @ t for name, t in bones.items()}, moved(flesh)).x
    np.testing.assert_allclose(there, moved(fleshed.solve(bones, flesh).x), atol=1e-6)


def test_saved_and_loaded_hooks_lie_in_the_flesh(fleshed: Tendon, tmp_path: Path) -> None:
    fleshed.save(tmp_path / "tendon.h5")
    loaded = Tendon.load(tmp_path / "tendon.h5")
    bones, flesh = pose(0.7, 0.5), pushed(0.7, 0.5, 2.0)
    known = fleshed.solve(bones, flesh.vertices).x
    np.testing.assert_array_equal(loaded.solve(bones, flesh.vertices).x, known)
    layer = TendonLayer([loaded])
    shapes = layer.solve(Frame("bent", {}, bones), {"flesh": {"flesh_mesh": flesh}})
    np.testing.assert_array_equal(shapes["extensor_centreline"].vertices, known)
    with pytest.raises(ValueError, match="lie in the flesh"):
        layer.solve(Frame("bent", {}, bones), {})


@pytest.mark.parametrize("known", [["neutral"], ["neutral", "middle"]], ids=["neutral alone", "one joint"])
@pytest.mark.parametrize("angles", [(0.4, 0.3), (0.0, 0.5), (0.8, 0.6)])
def test_where_examples_move_no_joint_the_closest_bones_carry_hooks(
    known: list[str], angles: tuple[float, float]
) -> None:
    """Scans of neutral alone, or with one joint never moved, tell nothing of the weights there."""
    rest, given = rest_tendon(), {"neutral": (0.0, 0.0), "middle": (0.8, 0.0)}
    rods = {name: true_rod(rest, *given[name]) for name in known}
    poses = {name: pose(*given[name]) for name in known}
    built = build_tendon("extensor", rest, RADIUS, bone_surfaces(), RegisteredRods(rods, poses, PARENTS))
    errors = centreline_errors(built.solve(pose(*angles)).x, true_rod(rest, *angles))
    assert max(e.max() for e in errors) < 0.75
