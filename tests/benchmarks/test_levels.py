"""The benchmark of levels: errors of a known displacement, coverage, seconds, table and picture."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from benchmarks.levels import creases, measured
from benchmarks.levels.contractions import coarser
from benchmarks.levels.document import main, table
from benchmarks.levels.truth import _distances, _shown
from tests.levels.three_bones import random_frames, rig

from handpipe.core import ConvergenceError, Shape, metrics
from handpipe.levels import LearnedHand, TrainingSet, learn
from handpipe.mesh.surfaces.surface import Surface
from handpipe.tissues.fat.skin import Rigid, Skin


@pytest.fixture(scope="module")
def hand() -> LearnedHand:
    return learn(random_frames(30), rig())


@pytest.fixture(scope="module")
def tested() -> TrainingSet:
    return TrainingSet.of(random_frames(6, seed=8))


def test_errors_are_the_distances_of_the_vertices(hand: LearnedHand, tested: TrainingSet) -> None:
    """Frames that are moved by 3 mm from what the hand gives."""
    bodies = dict(tested.bodies)
    given = [hand.split(hand.moved(m, a, "L1")) for m, a in zip(tested.motions, tested.angles, strict=True)]
    for body, shape in tested.bodies.items():
        bodies[body] = replace(shape, vertices=np.stack([x[body] for x in given]) + [0, 3, 0])
    found = measured._errors(hand, replace(tested, bodies=bodies), "L1")
    for name in ("skin", "muscles"):
        assert found[f"l1_{name}_error_mean"] == (pytest.approx(3.0, rel=1e-5), "mm")
        assert found[f"l1_{name}_error_max"] == (pytest.approx(3.0, rel=1e-5), "mm")
    assert measured._bounds(hand, replace(tested, bodies=bodies))["l1_covered"][0] == 0.0


def test_most_frames_are_within_the_stated_errors(hand: LearnedHand, tested: TrainingSet) -> None:
    found = measured._bounds(hand, tested)
    assert found["covered_expected"][0] == pytest.approx(6 / 7)
    assert found["l1_covered"][0] >= 0.5


def test_seconds_are_of_the_bodies_that_are_asked_for(hand: LearnedHand, tested: TrainingSet) -> None:
    found = measured.seconds(hand, tested.angles)
    assert found["vertices_skin"][0] == len(hand.bodies["fat", "skin"].rest)
    assert found["vertices_everything"][0] == len(hand.rest)
    assert 0 < found["l0_skin_seconds"][0] < 0.1


def test_errors_against_truth_are_distances_to_its_surfaces() -> None:
    """Spheres of 10 mm against true ones of 10.5 mm; the cut end, which is far off, does not count."""

    def sphere(radius: float) -> Surface:
        mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
        return Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces))

    inner, outer = sphere(10.0), sphere(10.5)
    true = {"skin": {"skin": outer}, "muscles": {"muscle": outer}}
    made = {
        "fat": {"skin": inner},
        "muscles": {"muscle": inner, "muscle_mesh": inner},
        "bones": {"bone": inner},
    }
    shapes = {
        layer: {
            name: Shape(
                s.vertices,
                s.vertices.copy(),
                np.zeros((0, 4), int) if name.endswith("_mesh") else s.triangles,
            )
            for name, s in bodies.items()
        }
        for layer, bodies in made.items()
    }
    shapes["fat"]["skin"].vertices[:5] += 30.0
    found = _distances(_shown(shapes), true, np.arange(5))
    assert found["skin"] == pytest.approx(np.full(len(inner.vertices) - 5, 0.5), abs=0.02)
    assert found["muscles"] == pytest.approx(np.full(len(found["muscles"]), 0.5), abs=0.02)
    assert len(found["muscles"]) > 0


def test_table_and_picture(tmp_path: Path) -> None:
    found: metrics.Metrics = {"hand_simulated_seconds": (9.0, "s")}
    for level in ("l0", "l1"):
        for what in ("skin", "organs", "everything"):
            found[f"hand_{level}_{what}_seconds"] = (0.0012, "s")
        for tissue in ("skin", "muscles", "tendons", "tendons_surface", "ligaments"):
            found[f"hand_{level}_{tissue}_error_mean"] = (0.25, "mm")
            found[f"hand_{level}_{tissue}_error_max"] = (2.0, "mm")
    found |= {"hand_l1_skin_error_mean_16": (0.4, "mm"), "hand_l1_skin_error_mean_32": (0.25, "mm")}
    found |= {f"hand_l2_{what}_seconds": (0.012, "s") for what in ("skin", "organs", "everything")}
    found |= {"hand_l2_skin_error_mean": (0.5, "mm"), "hand_l2_skin_error_max": (4.0, "mm")}
    assert "| hand, L2 | 12.00; 12.00; 12.00 | 0.500; 4.0 |  |  |" in table(found)
    assert "| hand, L1 | 1.20; 1.20; 1.20 | 0.250; 2.0 |" in table(found)
    metrics.write(tmp_path / "levels.json", found)
    main([str(tmp_path / "levels.json"), "--output", str(tmp_path / "levels.png")])
    assert (tmp_path / "levels.png").stat().st_size > 5000
    assert (tmp_path / "levels.md").read_text(encoding="utf-8") == table(found)


def test_the_coarser_skin_has_the_nodes_of_albrecht_and_its_rigid_parts() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=40.0)
    fine = Surface(np.asarray(mesh.vertices) * [1.0, 0.8, 1.4], np.asarray(mesh.faces))
    ends = Rigid("palm", np.flatnonzero(fine.vertices[:, 2] < -40))
    found = coarser(Skin(fine, {"cut_end": ends}))
    assert 1500 <= len(found.surface.vertices) < len(fine.vertices)
    places = found.surface.vertices[found.rigid["cut_end"].vertices, 2]
    assert len(places) > 20
    assert places.max() < -38
    assert found.surface.volume() == pytest.approx(fine.volume(), rel=0.01)


class KnownFinger:
    """Poses of a ball as skin: L3 is 0.5 mm off, the full model right, the uniform tissue 2 mm off."""

    def __init__(self) -> None:
        mesh = trimesh.creation.icosphere(subdivisions=3, radius=10.0)
        self.ball = Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces))

    def grown(self, by: float) -> Surface:
        return self.ball.moved(self.ball.vertices * (1 + by / 10.0))

    def simulated(self, pose: str):
        if pose == "fist":
            raise ConvergenceError("skin", "no room")
        surface = self.grown(0.5)
        figures = {"fold_depth": 1.0, "fold_angle": 80.0, "skin_crossings": 0.0}
        skin = Shape(self.ball.vertices, surface.vertices, surface.triangles, figures=figures)
        return {"skin": skin, "skin_mesh": replace(skin, figures={"inverted_tets": 0.0})}

    def true_points(self, pose: str) -> np.ndarray:
        return self.ball.vertices

    def built_skins(self, pose: str) -> dict[str, Surface]:
        return {"full": self.ball, "uniform": self.grown(2.0)}


def test_errors_with_creases_are_beside_those_of_the_other_models() -> None:
    found = creases._of_poses(KnownFinger(), ["half", "fist", "reach"])
    for model, error in (("creases", 0.5), ("full", 0.0), ("uniform", 2.0)):
        assert found[f"{model}_error_median"][0] == pytest.approx(error, abs=0.03)  # chords of the ball
    assert found["failed"] == (1.0, "frames")
    assert found["fold_depth_max"] == (1.0, "mm")
    assert 0 < found["seconds"][0] < 1
    assert creases._of_poses(KnownFinger(), ["fist"]) == {"failed": (1.0, "frames")}
