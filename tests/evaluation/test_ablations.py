"""Variants of the full model change what they say and nothing else, on a manufactured finger."""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from tests.evaluation.test_baselines import HOME
from tests.tissues.fat import two_bones
from tests.tissues.fat.limb import capsule
from tests.tissues.tendons.finger import BONES, PARENTS, bone_surfaces, flexor, flexor_course, pose

from handpipe.core import LAYERS, Frame, Region, RigidTransform, Shape, Shapes, artifacts, metrics
from handpipe.core.configuration import Role
from handpipe.evaluation.surfaces import curve_distance
from handpipe.hand import read_frames, write_frames
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.joints.joint_tree import FittedPose
from handpipe.skeleton.posing import LocalPoseSpaces, PoseSpace
from handpipe.skeleton.posing.layer import BoneLayer, bone_regions
from handpipe.skeleton.rig import Rig
from handpipe.stages.baselines import (
    evaluate_ablations,
    mesh_ablated_fat,
    simulate_ablated_inner,
    simulate_ablated_skin,
)
from handpipe.stages.baselines.knuckles import AROUND, knuckles
from handpipe.stages.baselines.variants import PASSIVE, VARIANTS
from handpipe.stages.tissues import mesh_fat
from handpipe.tissues.fascia import ClothSettings, Fascia, bone_wrap
from handpipe.tissues.fascia.layer import FasciaLayer
from handpipe.tissues.fat import FatStrains, Skin, Tissue, TissueLayer
from handpipe.tissues.muscles import MuscleLayer
from handpipe.tissues.tendons import Tendon, TendonLayer

EXAMPLES = {"neutral": (0.0, 0.0), "little": (0.3, 0.2), "more": (0.6, 0.5)}
BETWEEN = (0.4, 0.3)  # rad, of the pose "held"
WIDE = 13.0  # mm, radius of the skin
EDGE = 4.0  # mm, of tets
DATASET = SimpleNamespace(
    tendons={"flexor": None}, muscles={}, ligaments={}, fleshed=False, neutral="neutral"
)
LAYER_OF = {
    "tendons": TendonLayer,
    "muscles": MuscleLayer,
    "bone_fascia": FasciaLayer,
    "muscle_fascia": FasciaLayer,
}


@cache
def rig() -> Rig:
    at_home = FittedPose(HOME, {}, frozenset())
    still = FittedPose(RigidTransform.identity(), {}, frozenset())
    return Rig("base", (), bone_surfaces(), {"neutral": still, "held": at_home})


@cache
def tendon() -> Tendon:
    return flexor(EXAMPLES)


@cache
def fascia() -> Fascia:
    bones = bone_surfaces()
    surface = bone_wrap(bones, [("base", "middle"), ("middle", "distal")], 2.0)
    regions = bone_regions(surface.vertices, bones, 4.0, 0.5)
    regions[::7] = Region.sliding
    return Fascia.around("bone_fascia", surface, regions, bones, ClothSettings())


def full(name: str, angles: tuple[float, float]) -> tuple[Frame, dict[str, Shapes]]:
    """All layers of the full model in a pose."""
    frame = Frame(name, {}, pose(*angles))
    shapes: dict[str, Shapes] = {}
    for layer in (
        BoneLayer(bone_surfaces()),
        FasciaLayer(fascia(), "bones"),
        TendonLayer([tendon()]),
    ):
        shapes[layer.name] = layer.solve(frame, shapes)
    return frame, shapes


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The full model's artifacts."""
    made = tmp_path_factory.mktemp("full")
    rig().save(made / "rig.h5")
    tendon().save(made / "hooks.h5")
    fascia().save(made / "bone.h5", [])
    for name, angles in {"neutral": (0.0, 0.0), "held": BETWEEN}.items():
        write_frames(made / f"{name}.h5", [full(name, angles)])
    surface = capsule(WIDE, 4.0, 125.0)
    skin = surface.moved(surface.vertices + [27.0, 0.0, 0.0])
    Skin(skin, {}).save(made / "skin.h5", [])
    given = mesh_fat.Inputs(rig=made / "rig.h5", inner=made / "neutral.h5", skin=made / "skin.h5")
    mesh_fat.mesh_fat(given, made / "fat.h5", EDGE)
    poses = {name: pose(*angles) for name, angles in EXAMPLES.items()}
    tissue = Tissue.load(made / "fat.h5")
    logs = np.zeros((len(poses), len(tissue.mesh.tets), 6))
    logs[1, :, 0] = 0.02
    spaces = LocalPoseSpaces.build(BONES, PARENTS, poses, "rbf")
    FatStrains(spaces, logs, {}).save(made / "strains.h5", [])
    return made


def under_fat(folder: Path, variant: str, truth: tuple[Path, ...] = ()) -> tuple[Frame, Mapping[str, Shapes]]:
    """What the stage gives for the pose "held"."""
    file = {"tendons": "hooks.h5", "bone_fascia": "bone.h5", "bones": "rig.h5"}
    inputs = simulate_ablated_inner.Inputs(
        rig=folder / "rig.h5",
        inner=folder / "held.h5",
        layers=[folder / file[layer] for layer in VARIANTS[variant].loaded if layer in file],
        flesh=None,
        truth=truth,
    )
    simulate_ablated_inner.simulate_ablated_inner(inputs, folder / f"{variant}.h5", DATASET, variant)
    [found] = read_frames(folder / f"{variant}.h5")
    return found


def same(a: Shapes, b: Shapes) -> bool:
    return a.keys() == b.keys() and all(np.array_equal(a[n].vertices, b[n].vertices) for n in a)


@pytest.mark.parametrize(
    ("variant", "missing", "changed"),
    [
        ("no_tendons", {"tendons"}, set()),
        ("no_fasciae", {"bone_fascia"}, set()),
        ("no_sliding", set(), {"bone_fascia"}),
        ("no_hook_corrections", set(), {"tendons"}),
        ("eq1_weights", set(), {"tendons"}),
    ],
)
def test_a_variant_changes_its_layers_alone(folder: Path, variant: str, missing: set, changed: set):
    [(_, before)] = read_frames(folder / "held.h5")
    _, after = under_fat(folder, variant)
    assert before.keys() - after.keys() == missing
    assert {name for name in after if not same(before[name], after[name])} == changed


def test_uncorrected_hooks_are_where_their_bones_take_them(folder: Path):
    own = tendon()
    bare = own.without_corrections()
    moved = own.hooks.carried(pose(*BETWEEN))
    assert np.abs(own.hooks.corrections).max() > 0.1
    np.testing.assert_array_equal(bare.hook_positions(pose(*BETWEEN)), moved)
    _, after = under_fat(folder, "no_hook_corrections")
    x = after["tendons"]["flexor_centreline"].vertices
    np.testing.assert_allclose(x, bare.solve(pose(*BETWEEN)).x, atol=1e-9)


def test_weights_of_eq_1_are_inverse_distances_and_exact_at_examples():
    poses = {name: pose(*angles) for name, angles in EXAMPLES.items()}
    space = PoseSpace.build(BONES, PARENTS, poses, "rbf").by_inverse_distance()
    vectors = np.array([[a, b] for a, b in EXAMPLES.values()])  # rad: hinges about one axis
    relative = np.column_stack([vectors[:, 0] + vectors[:, 1], vectors[:, 0]])  # to the base
    at = np.array([BETWEEN[0] + BETWEEN[1], BETWEEN[0]])
    nearness = 1 / np.linalg.norm(relative - at, axis=1)
    np.testing.assert_allclose(space.weights(pose(*BETWEEN)), nearness / nearness.sum(), rtol=1e-6)
    np.testing.assert_array_equal(space.weights(poses["more"]), [0, 0, 1])


@pytest.mark.parametrize("variant", ["no_tendons", "no_fasciae", "no_sliding"])
def test_the_fat_lies_on_what_is_left(folder: Path, variant: str):
    inputs = mesh_ablated_fat.Inputs(
        rig=folder / "rig.h5", inner=folder / "neutral.h5", skin=folder / "skin.h5", fat=folder / "fat.h5"
    )
    mesh_ablated_fat.mesh_ablated_fat(inputs, folder / "own.h5", EDGE, variant)
    before, after = Tissue.load(folder / "fat.h5"), Tissue.load(folder / "own.h5")
    expected = {
        "no_tendons": {"bone_fascia"},
        "no_fasciae": {"bones", "tendons"},
        "no_sliding": {"bone_fascia", "tendons"},
    }
    assert set(before.inner.layers) == {"bone_fascia", "tendons"}
    assert set(after.inner.layers) == expected[variant]
    assert (before.inner.region == Region.sliding).any()
    np.testing.assert_array_equal(after.skin.vertices, before.skin.vertices)
    tissue = [float((t.occupancy * t.mesh.volumes()).sum()) for t in (before, after)]
    tube = np.pi * 1.3**2 * 100  # mm^3 of a tendon, about
    if variant == "no_tendons":  # fat fills its place, and the clefts beside it
        assert tissue[1] - tissue[0] > 0.5 * tube
    if variant == "no_sliding":
        np.testing.assert_array_equal(after.mesh.vertices, before.mesh.vertices)
        slid = before.inner.region == Region.sliding
        assert (after.inner.region[slid] == Region.fixed).all()
        np.testing.assert_array_equal(after.inner.region[~slid], before.inner.region[~slid])


def test_skins_of_a_variant_with_and_without_strains(folder: Path):
    under_fat(folder, "no_hook_corrections")
    inputs = simulate_ablated_skin.Inputs(
        inner=folder / "no_hook_corrections.h5", fat=folder / "fat.h5", strains=folder / "strains.h5"
    )
    simulate_ablated_skin.simulate_ablated_skin(inputs, folder / "skins.h5", "no_hook_corrections")
    [(frame, skins)] = read_frames(folder / "skins.h5")
    assert [*skins] == ["no_hook_corrections", f"no_hook_corrections{PASSIVE}"]
    _, below = under_fat(folder, "no_hook_corrections")
    strains = FatStrains.load(folder / "strains.h5")
    layer = TissueLayer("fat", Tissue.load(folder / "fat.h5"), strains, strict=False)
    strained, passive = (shapes["skin"].vertices for shapes in skins.values())
    expected = layer.without_strains().solve(frame, below)["skin"].vertices
    np.testing.assert_allclose(passive, expected, atol=1e-6)
    longer = np.ptp(strained[:, 0]) - np.ptp(passive[:, 0])
    assert 0.05 < longer < 2.0  # mm: the strains of the example nearby lengthen the fat along x


def test_true_organs_are_the_truths_in_the_simulations_frame(folder: Path):
    """The truth lies in the scanner's frame, which differs from the simulation's by `HOME`."""
    turned = {name: RigidTransform.about(np.zeros(3), twist(0.01)) @ b for name, b in pose(*BETWEEN).items()}
    line = flexor_course(*BETWEEN)[::-1] + [0.0, 0.5, 0.0]  # written the other way, towards the insertion
    bones = {
        n: {"rotation": (HOME @ b).rotation, "translation": (HOME @ b).translation} for n, b in turned.items()
    }
    tendons = {"flexor": {"centreline": HOME(line), "radius": 1.3}}
    artifacts.write(
        folder / "truth" / "held.h5", {"bones": bones, "tendons": tendons, "muscles": {}}, kind="truth"
    )
    truth = (folder / "truth" / "held.h5",)
    [(frame, before)] = read_frames(folder / "held.h5")

    same_frame, after = under_fat(folder, "true_tendons", truth)
    x = after["tendons"]["flexor_centreline"].vertices
    first = frame.bones["distal"](tendon().rest.x[:1])[0]
    np.testing.assert_allclose(x[0], first, atol=1e-9)
    beyond = x[:, 0] < line[0, 0]  # the rod goes on straight where the line ends
    assert np.count_nonzero(~beyond) > 0.9 * len(x)
    assert curve_distance(x[3:][~beyond[3:]], line).max() < 0.01
    np.testing.assert_allclose(np.linalg.norm(np.diff(x, axis=0), axis=1), tendon().rest.length, rtol=1e-6)
    assert all(same(before[name], after[name]) for name in ("bones", "bone_fascia"))
    np.testing.assert_array_equal(same_frame.bones["distal"].rotation, frame.bones["distal"].rotation)

    true_frame, after = under_fat(folder, "true_bones", truth)
    np.testing.assert_allclose(
        after["bones"]["middle"].vertices, turned["middle"](rig().surfaces["middle"].vertices), atol=1e-9
    )
    np.testing.assert_allclose(true_frame.bones["distal"].rotation, turned["distal"].rotation, atol=1e-12)


def twist(angle: float) -> np.ndarray:
    return Rotation.from_rotvec([angle, 0.0, 0.0]).as_matrix()


@pytest.mark.parametrize("name", VARIANTS)
def test_records_name_layers_and_changes_that_exist(name: str):
    variant = VARIANTS[name]
    for layers in (variant.without, variant.solved, variant.true, variant.refitted, variant.under_fat):
        assert set(layers) <= LAYERS.keys()
    assert set(variant.refitted) <= set(variant.loaded)
    if variant.change:
        assert any(hasattr(LAYER_OF[layer], variant.change) for layer in variant.solved)
    assert variant.own_fat == (variant.under_fat != VARIANTS["eq1_weights"].under_fat) or hasattr(
        Tissue, variant.change
    )
    # What solves again what a layer needs solves the layer, too: no shape is of another model's shapes.
    new = {*variant.without, *variant.solved, *variant.true} - {"bone_fascia"}
    kept = [layer for layer in ("tendons", "muscles", "muscle_fascia", "ligaments") if layer not in new]
    assert not any(new & set(LAYERS[layer].needs) for layer in kept)


def test_a_knuckle_is_the_dorsal_skin_over_its_joint_where_it_is_bent_most():
    poses = {name: two_bones.bent(degrees) for name, degrees in {"a": 10.0, "b": 50.0, "c": 30.0}.items()}
    found = two_bones.rig()
    fitted = {n: FittedPose(RigidTransform.identity(), dict(f.angles), frozenset()) for n, f in poses.items()}
    jointed = Rig(found.root, found.joints, found.surfaces, fitted)
    skin = two_bones.skin()
    [knuckle] = knuckles(jointed, skin, [*poses], [("far", "near")])
    x, y, z = skin.surface.vertices[knuckle.vertex]
    assert knuckle.pose == "b"
    assert abs(x + 2.0) < 1.5  # mm: the joint's centre is at x = -2, and flexion bends to -z
    assert abs(y) < 1.5
    assert z > 0.9 * two_bones.FLESH
    reach = np.linalg.norm(skin.surface.vertices - [x, y, z], axis=1)
    np.testing.assert_array_equal(knuckle.near, reach < AROUND)
    assert knuckles(jointed, skin, [*poses], [("far", "other")]) == []


RADII = {"m0": 10.1, "m1": 10.4, "m2": 12.0, "no_tendons": 10.2, f"no_tendons{PASSIVE}": 10.6}
ROLES = {"fist": Role.example, "half": Role.heldout}


def test_errors_of_variants_are_the_differences_of_the_radii(tmp_path: Path):
    ball = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    poses = {pose: FittedPose(HOME, {}, frozenset()) for pose in ROLES}
    Rig("a", (), {"a": Surface(3.0 * ball.vertices, ball.faces)}, poses).save(tmp_path / "rig.h5")
    Skin(Surface(10.0 * ball.vertices, ball.faces), {}).save(tmp_path / "skin.h5", [])
    kinds = {"skins": ["m0"], "passive": ["m1", "m2"], "ablated_skins": [*RADII][3:]}
    files: dict[str, list[Path]] = {"scans": [], "truth": [], **{kind: [] for kind in kinds}}
    for pose_ in ROLES:
        frame = Frame(pose_, {}, {"a": RigidTransform.identity()})
        shapes = {
            m: {"skin": Shape(10 * ball.vertices, r * ball.vertices, ball.faces)} for m, r in RADII.items()
        }
        for kind, models in kinds.items():
            files[kind].append(tmp_path / f"{pose_}-{kind}.h5")
            write_frames(files[kind][-1], [(frame, {m: shapes[m] for m in models})])
        files["scans"].append(tmp_path / f"{pose_}.ply")
        scan = trimesh.Trimesh(HOME(10.0 * ball.vertices), ball.faces, process=False)
        scan.export(files["scans"][-1])
        files["truth"].append(tmp_path / f"{pose_}.h5")
        skin = {"vertices": HOME(10.0 * ball.vertices), "triangles": ball.faces}
        artifacts.write(files["truth"][-1], {"skin": skin, "tendons": {}, "muscles": {}}, kind="truth")
    given = evaluate_ablations.Inputs(
        rig=tmp_path / "rig.h5", skin=tmp_path / "skin.h5", inner=[], ablated_inner=[], **files
    )
    outputs = evaluate_ablations.Outputs(metrics=tmp_path / "m.json", table=tmp_path / "t.json")
    dataset = SimpleNamespace(
        poses={p: SimpleNamespace(role=role) for p, role in ROLES.items()}, truth=True, tendons={}
    )
    evaluate_ablations.evaluate_ablations(given, outputs, dataset, [])
    figures = {name: value for name, (value, _) in metrics.read(outputs.metrics).items()}
    facets = 0.02  # mm that a triangle of the balls lies below its corners
    for role in ("example", "true_heldout"):
        assert figures[f"m0_{role}_error_mean"] == pytest.approx(0.1, abs=facets)
        assert figures[f"m0{PASSIVE}_{role}_error_mean"] == pytest.approx(0.4, abs=facets)
        assert figures[f"no_tendons_{role}_error_mean"] == pytest.approx(0.2, abs=facets)
        assert figures[f"no_tendons{PASSIVE}_{role}_error_mean"] == pytest.approx(0.6, abs=facets)
    assert not any(name.startswith("m2") for name in figures)
    assert {row["model"] for row in json.loads(outputs.table.read_text())} == {
        "m0", f"m0{PASSIVE}", "no_tendons", f"no_tendons{PASSIVE}",
    }  # fmt: skip
