"""Springs against analytic equilibria and scipy, muscles against cylinders, the skin over both."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from handpipe.core.configuration import Scene, load_dataset
from handpipe.core.errors import ConvergenceError
from handpipe.core.layers import Frame
from handpipe.core.rigid import RigidTransform
from handpipe.hand.frames import read_frames
from handpipe.levels.joint_neighbours import bones_between
from handpipe.levels.mass_spring import GeometricMuscle, MassSpring, SpringHand, Springs
from handpipe.levels.mass_spring.followers import duals_of
from handpipe.mesh.surfaces.surface import Surface
from handpipe.stages.levels import animate_springs
from handpipe.tissues.fat.skin import Rigid, Skin
from handpipe.tissues.muscles.fitting.soft_body import SoftBody
from handpipe.tissues.muscles.muscle import Examples, Muscle

from .three_bones import BONES, motions, rig, tube

DATA = load_dataset(Path(__file__).parents[2] / "config/datasets/phantom-hand-preview.yaml")
BELLY = np.array([10.0, 0.0, -6.0])  # of the muscle, below the first joint: bending shortens it


def as_arrays(transforms) -> np.ndarray:
    return np.array([np.column_stack([t.rotation, t.translation]) for t in transforms])


def ball() -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=10.0)
    return Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def spindle() -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    return Surface(np.asarray(mesh.vertices) * [9.0, 2.5, 1.6] + BELLY, np.asarray(mesh.faces))


def muscle() -> Muscle:
    surface = spindle()
    x = surface.vertices[:, 0]
    attachments = {"palm": np.flatnonzero(x < 2.5), "first": np.flatnonzero(x > 17.5)}
    body = SoftBody.fill(surface, attachments, 2.0)
    return Muscle.fit("flexor", body, Examples({"first": "palm", "second": "first"}, "rest", {}), {})[0]


def skin() -> Skin:
    surface = tube(8.0)
    return Skin(surface, {"cut_end": Rigid("palm", np.flatnonzero(surface.vertices[:, 0] < -4.9))})


@pytest.fixture(scope="module")
def hand() -> SpringHand:
    return SpringHand.of(rig(), skin(), [muscle()])


def at(*degrees: float) -> np.ndarray:
    return as_arrays(motions(np.radians(degrees)))


def test_two_springs_meet_where_their_forces_are_equal() -> None:
    springs = Springs(np.array([[0, 1], [1, 2]]), np.array([2.0, 3.0]), np.array([5.0, 1.0]))
    ends = np.array([[0.0, 0, 0], [4.0, 0.5, 0], [9.0, 0, 0]])
    system = MassSpring(springs, np.zeros(3), np.array([True, False, True]))
    found = system.settle(ends, tolerance=1e-9).nodes
    place = (5 * 2 + 1 * (9 - 3)) / (5 + 1)  # 5 (x - 2) = 1 (9 - x - 3)
    assert found[1] == pytest.approx([place, 0, 0], abs=1e-6)
    assert np.array_equal(found[[0, 2]], ends[[0, 2]])


def energy(x: np.ndarray, springs: Springs, targets: np.ndarray, holding: np.ndarray) -> float:
    """The energy once more, in numpy alone."""
    x = x.reshape(-1, 3)
    lengths = np.linalg.norm(np.diff(x[springs.ends], axis=1)[:, 0], axis=1)
    stretched = springs.stiffness * (lengths - springs.lengths) ** 2
    return float(stretched.sum() + (holding[:, None] * (x - targets) ** 2).sum()) / 2


def test_the_equilibrium_is_the_minimum_that_scipy_finds() -> None:
    surface, generator = ball(), np.random.default_rng(0)
    targets = surface.vertices * [1.3, 0.8, 1.0] + generator.normal(0, 0.8, surface.vertices.shape)
    springs = Springs.of(surface, rest=0.6)
    holding = generator.uniform(0.5, 2.0, len(targets))
    settled = MassSpring(springs, holding, np.zeros(len(targets), np.bool_)).settle(targets, tolerance=1e-8)
    least = minimize(energy, targets.ravel(), (springs, targets, holding), method="L-BFGS-B",
                     options={"maxiter": 400, "maxfun": 10**6, "ftol": 1e-13, "gtol": 1e-6})  # fmt: skip
    assert settled.energies[-1] == pytest.approx(energy(settled.nodes, springs, targets, holding), rel=1e-12)
    assert settled.energies[-1] <= least.fun * (1 + 1e-9)
    assert np.abs(settled.nodes - least.x.reshape(-1, 3)).max() < 2e-3
    assert np.abs(settled.nodes - targets).max() > 0.5


@pytest.mark.parametrize("rest", [0.5, 1.0])
def test_energy_falls_in_every_step_whatever_the_start(rest: float) -> None:
    surface = ball()
    system = MassSpring(
        Springs.of(surface, rest=rest), np.full(len(surface.vertices), 0.1), surface.vertices[:, 2] < -9
    )
    start = np.random.default_rng(1).normal(0, 30, surface.vertices.shape)
    settled = system.settle(surface.vertices, start, most=2000)
    assert (np.diff(settled.energies) < 0).all()
    assert settled.residual <= 0.1
    assert np.array_equal(settled.nodes[system.fixed], surface.vertices[system.fixed])


def test_too_few_iterations_are_an_error_that_says_how_far_it_is() -> None:
    surface = ball()
    system = MassSpring(Springs.of(surface), np.full(len(surface.vertices), 0.01), np.zeros(162, np.bool_))
    with pytest.raises(ConvergenceError, match="after 2 iterations a step still moves a node by"):
        system.settle(surface.vertices * [0.2, 1, 1], most=2)


def cylinder_between(joined: float) -> tuple[GeometricMuscle, list[RigidTransform]]:
    """A cylinder of 40 mm on two bones at its ends, the second of which comes nearer by a share of it."""
    mesh = trimesh.creation.cylinder(radius=5.0, height=40.0, sections=24).subdivide().subdivide().subdivide()
    surface = Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    z = surface.vertices[:, 2]
    attachments = {"a": np.flatnonzero(z < -19.9), "b": np.flatnonzero(z > 19.9)}
    small = trimesh.creation.icosphere(subdivisions=2, radius=5.0)
    bones = {
        name: Surface(np.asarray(small.vertices) + [0, 0, z], np.asarray(small.faces))
        for name, z in (("a", -25.0), ("b", 25.0))
    }
    made = GeometricMuscle.of("cylinder", surface, attachments, bones, {"a": 0, "b": 1})
    nearer = RigidTransform(np.eye(3), np.array([0, 0, -40.0 * joined]))
    return made, [RigidTransform.identity(), nearer]


@pytest.mark.parametrize("joined", [0.1, 0.25, -0.15])
def test_a_cylinder_keeps_its_volume_and_thickens_by_the_root_of_its_stretch(joined: float) -> None:
    made, moved = cylinder_between(joined)
    bulge = made.posed(duals_of(as_arrays(moved)))
    carried = made.surface.moved(bulge.vertices - bulge.shift).volume()
    assert abs(carried / made.volume - 1) > 0.8 * abs(joined)  # without the bulge
    assert made.surface.moved(bulge.vertices).volume() == pytest.approx(made.volume, rel=0.01)
    assert abs(bulge.volume_error) < 1e-9
    assert bulge.stretch == pytest.approx(1 - joined, abs=0.02)
    thickest = np.linalg.norm(bulge.vertices[:, :2], axis=1)
    even = 5.0 / np.sqrt(1 - joined)
    extreme = thickest.max() if joined > 0 else thickest[np.abs(made.surface.vertices[:, 2]) < 2].max()
    assert (extreme - 5.0) / (even - 5.0) == pytest.approx(1.5, abs=0.4)  # the attached ends keep their width
    ends = np.abs(made.surface.vertices[:, 2]) > 19.9
    assert np.abs(bulge.shift[ends]).max() < 1e-4


def test_a_muscle_that_cannot_bulge_as_much_says_what_volume_is_missing() -> None:
    made, moved = cylinder_between(-2.0)
    bulge = made.posed(duals_of(as_arrays(moved)))
    assert bulge.thickening == -0.5
    assert bulge.volume_error == pytest.approx(made.surface.moved(bulge.vertices).volume() / made.volume - 1)
    assert bulge.volume_error > 0.01


def test_a_muscle_is_carried_by_the_bones_between() -> None:
    made = rig()
    assert bones_between(made, ["palm", "second"]) == ["palm", "first", "second"]
    assert bones_between(made, ["second"]) == ["second"]
    assert bones_between(made, ["second", "first"]) == ["first", "second"]


def test_a_rigid_motion_of_all_bones_carries_skin_and_muscles(hand: SpringHand) -> None:
    motion = RigidTransform(Rotation.from_rotvec([0.3, -1.1, 2.0]).as_matrix(), np.array([30.0, -12, 5]))
    settled, bulges = hand.posed(as_arrays([motion] * len(BONES)))
    assert np.abs(settled.nodes - motion(hand.skin.vertices)).max() < 1e-3
    assert np.abs(bulges["flexor"].vertices - motion(hand.muscles[0].surface.vertices)).max() < 1e-3
    assert bulges["flexor"].stretch == pytest.approx(1)


def test_a_frame_does_not_depend_on_those_before(hand: SpringHand) -> None:
    first = hand.posed(at(50, 30))[0].nodes
    hand.posed(at(-15, 70))
    assert np.array_equal(hand.posed(at(50, 30))[0].nodes, first)
    again = SpringHand.of(rig(), skin(), [muscle()])
    assert np.array_equal(again.posed(at(50, 30))[0].nodes, first)


def test_the_skin_over_a_muscle_that_shortens_bulges(hand: SpringHand) -> None:
    settled, bulges = hand.posed(at(50, 0))
    assert bulges["flexor"].stretch < 0.95
    assert bulges["flexor"].thickening > 0.02
    stiff = replace(hand, muscles=tuple(replace(m, profile=0 * m.profile) for m in hand.muscles))
    flat, same = stiff.posed(at(50, 0))
    assert np.abs(same["flexor"].shift).max() == 0
    [touch] = hand.touches
    belly = touch.nodes[np.abs(hand.skin.vertices[touch.nodes, 0] - 7.5) < 0.1]
    assert len(belly) > 2
    assert (flat.nodes - settled.nodes)[belly, 2].mean() > 0.05  # the muscle lies below


def test_rigid_parts_lie_on_their_bones(hand: SpringHand) -> None:
    ends = skin().rigid["cut_end"].vertices
    assert len(ends) > 10
    assert np.abs(hand.posed(at(70, 60))[0].nodes[ends] - hand.skin.vertices[ends]).max() < 1e-5


def test_a_scene_of_springs_has_its_layers_and_figures(tmp_path: Path) -> None:
    rig().save(tmp_path / "rig.h5")
    skin().save(tmp_path / "skin.h5", [])
    muscle().save(tmp_path / "muscle.h5")
    (tmp_path / "angles.csv").write_text("frame,first_bend [deg],second_bend [deg]\nrest,0,0\nbent,60,50\n")
    for layers in (["muscles", "skin"], ["bones", "skin"]):
        scene = Scene.model_validate({"layers": layers, "frames": tmp_path / "angles.csv", "level": "L2"})
        muscles = [tmp_path / "muscle.h5"] if "muscles" in layers else []
        files = (tmp_path / "rig.h5", tmp_path / "angles.csv", tmp_path / "skin.h5", muscles)
        animate_springs.animate_springs(
            animate_springs.Inputs(*files), tmp_path / "frames.h5", DATA, scene, 0
        )
        frames = read_frames(tmp_path / "frames.h5")
        assert [frame.name for frame, _ in frames] == ["rest", "bent"]
        assert set(frames[1][1]) == {"bones", *layers}
        rest, bent = (shapes["skin"]["skin"] for _, shapes in frames)
        assert np.abs(rest.vertices - rest.rest).max() < 1e-3
        assert np.abs(bent.vertices - bent.rest).max() > 10
        assert 0 <= bent.figures["spring_residual"] <= 0.1


def test_what_is_outside_of_the_skin_is_told(hand: SpringHand) -> None:
    far = RigidTransform(np.eye(3), np.array([0.0, 0, 40]))
    still = RigidTransform.identity()
    shapes = hand.frame(Frame("far", {}, {"palm": still, "first": still, "second": still}))
    assert shapes["skin"]["skin"].figures["inner_overlap"] == 0
    torn = hand.frame(Frame("far", {}, {"palm": still, "first": far, "second": still}))
    assert torn["skin"]["skin"].figures["inner_overlap"] > 1
