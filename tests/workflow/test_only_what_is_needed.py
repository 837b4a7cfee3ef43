"""A build makes what its target and its scenes need, and a change reruns what depends on it."""

import json
import shutil
from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import yaml
from benchmarks.layered.__main__ import PARTS as LAYERED_PARTS
from benchmarks.trust.__main__ import PARTS
from benchmarks.trust.job_plans import JobPlan, plan
from benchmarks.trust.poses import CHUNKS
from benchmarks.trust.stale import Workbench, workbench
from snakemake.exceptions import WorkflowError
from tests.sampling import every

from handpipe.core.configuration.scene import Scene
from handpipe.skeleton.bones.bone_files import read_surfaces
from handpipe.skeleton.rig.rig import Rig

from .running import planned, run, working_copy
from .small_subject import LABELS, ball, seeds, write_dataset, write_image, write_mesh

SMALL = ("--config", "subjects=[small]")
DEEPER = ("muscle", "tendon", "ligament", "fascia", "fat", "hooks", "inner")


def deeper(rules: dict[str, int]) -> set[str]:
    return {rule for rule in rules if any(word in rule for word in DEEPER)}


@pytest.fixture(scope="module")
def nothing_built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return working_copy(tmp_path_factory.mktemp("needed") / "copy")


ALWAYS = {
    "all", "generate_pose", "segment_pose", "merge_labels", "register_bones", "fit_rig",
    "simulate", "export_scene", "evaluate_segmentation", "evaluate_registration", "evaluate_frames", "report",
    "evaluate_build", "require_frames",
}  # fmt: skip
SKIN = {"generate_templates", "make_skin"}
FLESH = {"mesh_flesh", "simulate_flesh", *SKIN}  # which carries tendons and muscles
TENDONS = {"extract_tendon", "register_tendon", "fit_hooks", "evaluate_tendons", *FLESH}
MUSCLES = {
    "place_templates", "extract_muscle", "separate_neutral", "extract_muscle_shapes", "separate_muscles",
    "fit_muscle_strains", "simulate_inner", "evaluate_muscles", "evaluate_poses", *FLESH,
}  # fmt: skip
# The rules that each layer brings, with those that it stands on.
RULES_OF = {
    "bones": set(),
    "bone_fascia": {"make_bone_fascia"},
    "tendons": TENDONS,
    "muscles": MUSCLES,
    "muscle_fascia": {"make_muscle_fascia", *MUSCLES},
    "ligaments": {"generate_templates", "place_templates", "fit_ligament"},
    "fat": {
        "make_bone_fascia", "make_muscle_fascia", "fit_ligament", "mesh_fat", "fit_fat_strains",
        "collect_fat_strains", "simulate_skin", "evaluate_skin", *MUSCLES, *TENDONS,
    },
    "skin": {"mesh_soft_tissue", *SKIN},
}  # fmt: skip


def needs_of_subsets() -> dict[frozenset[str], tuple[str, ...]]:
    """One subset of the layers for each set of layers that some subset needs."""
    subsets = (c for size in range(1, len(RULES_OF) + 1) for c in combinations(RULES_OF, size))
    found: dict[frozenset[str], tuple[str, ...]] = {}
    for layers in subsets:
        needed = frozenset(Scene(layers=layers, frames=Path("x.csv")).needed)
        found.setdefault(needed - {"skin"} if "fat" in needed else needed, layers)
    return found


@pytest.fixture(scope="module")
def bench() -> Iterator[Workbench]:
    with workbench() as made:
        yield made


def plan_of(bench: Workbench, layers: Sequence[str], target: str = "all") -> JobPlan:
    bench.before("phantom-finger")
    bench.write("scenes/flexion", {**bench.contents["scene"], "layers": list(layers)})
    given = {"subjects": ["phantom-finger"], "scenes": ["flexion"]}
    return plan(bench.folder, [target], given)


@pytest.mark.parametrize("layers", every(3, needs_of_subsets().values()), ids="-".join)
def test_all_builds_what_the_layers_need(bench: Workbench, layers: tuple[str, ...]) -> None:
    expected = ALWAYS.union(*(RULES_OF[layer] for layer in layers))
    assert plan_of(bench, layers).rules() == expected


@pytest.mark.parametrize("layers", [("tendons",), ("ligaments", "bone_fascia"), ("muscles",), ("fat",)])
def test_all_adds_nothing_but_figures_to_the_simulation(bench: Workbench, layers: tuple[str, ...]) -> None:
    """Whole jobs, not only rules: scanned poses are simulated where a stage or its comparison needs them."""
    figures = {"all", "simulation", "report", "simulate_skin", "require_frames"}
    further = {
        (job.rule, dict(job.wildcards).get("pose"))
        for job in plan_of(bench, layers).compared.keys()
        - plan_of(bench, layers, "simulation").compared.keys()
        if not job.rule.startswith("evaluate_") and job.rule not in figures
    }
    assert further <= {("simulate_flesh", "half"), ("simulate_inner", "half")} | (
        {("simulate_inner", pose) for pose in ("bow", "fist")} if layers == ("muscles",) else set()
    )


def test_an_unknown_generator_is_refused_before_any_job(bench: Workbench) -> None:
    """Beside it other subjects are planned as before."""
    finger = bench.contents["phantom-finger"]
    changed = {"name": "odd", "root": "results/odd/data", "generator": "phantom-foot"}
    bench.write("datasets/odd", {**finger, **changed})
    with pytest.raises(
        WorkflowError, match=r"odd\.yaml: generator: 'phantom-foot' is no generator; .*-finger"
    ):
        bench.plan("odd")
    assert plan_of(bench, ("bones",)).rules() == ALWAYS


def test_benchmark_of_trust_has_every_part(nothing_built: Path) -> None:
    """As docs/trust.md gives the command."""
    counts = planned(nothing_built, "benchmark_trust")
    assert (counts["benchmark_trust_part"], counts["benchmark_trust"]) == (len(PARTS), 1)
    assert counts["benchmark_trust_frames"] == len(CHUNKS)


def test_benchmark_of_layers_has_every_part(nothing_built: Path) -> None:
    counts = planned(nothing_built, "benchmark_layered")
    assert (counts["benchmark_layered_part"], counts["benchmark_layered"]) == (len(LAYERED_PARTS), 1)


def test_rig_needs_no_tissue(nothing_built: Path) -> None:
    rules = planned(nothing_built, "rig")
    assert deeper(rules) == set()
    assert "simulate" not in rules


def write_scene(folder: Path, name: str, text: str) -> None:
    scenes = folder / "config" / "scenes"
    (scenes / f"{name}.csv").write_text("frame,hinge_flexion [deg]\nrest,0\nbent,40\n")
    (scenes / f"{name}.yaml").write_text(f"{text}\nframes: config/scenes/{name}.csv\n")


def test_scans_are_needed_by_fat_and_skin_alone(small: Path) -> None:
    subject = yaml.safe_load((small / "config/datasets/small.yaml").read_text(encoding="utf-8"))
    for pose in subject["poses"].values():
        del pose["scan"]
    write_dataset(small, subject)
    write_scene(small, "inner", "layers: [bones, muscles, muscle_fascia]")
    rules = planned(small, "all", "--config", "subjects=[small]", "scenes=[inner]")
    assert {"fit_muscle_strains", "simulate", "report"} <= set(rules)
    assert {rule for rule in rules if "fat" in rule or "skin" in rule or "soft" in rule} == set()


def test_scan_of_an_example_is_not_needed_by_the_soft_tissue(small: Path) -> None:
    subject = yaml.safe_load((small / "config/datasets/small.yaml").read_text(encoding="utf-8"))
    del subject["poses"]["bent"]["scan"]
    write_dataset(small, subject)
    write_scene(small, "outer", "layers: [skin]")
    rules = planned(small, "all", "--config", "subjects=[small]", "scenes=[outer]")
    assert "make_skin" in rules and "extract_skin" not in rules


@pytest.mark.parametrize(
    ("poses", "from_volume", "layers", "extracted"),
    [
        (("flat", "bent"), None, "[skin]", 1),
        (("flat", "bent"), None, "[fat]", 2),
        (("bent",), None, "[fat]", 1),
        ((), True, "[fat]", 0),
        (("flat", "bent"), None, "[muscles]", 0),
        (("flat", "bent"), True, "[muscles]", 1),
    ],
)
def test_volumes_give_the_skins_that_scans_do_not(
    small: Path, poses: tuple[str, ...], from_volume: bool | None, layers: str, extracted: int
) -> None:
    subject = yaml.safe_load((small / "config/datasets/small.yaml").read_text(encoding="utf-8"))
    for pose in poses:
        del subject["poses"][pose]["scan"]
    write_dataset(small, subject | ({} if from_volume is None else {"skin_from_volume": from_volume}))
    write_scene(small, "asked", f"layers: {layers}")
    rules = planned(small, "all", "--config", "subjects=[small]", "scenes=[asked]")
    assert rules.get("extract_skin", 0) == extracted


@pytest.mark.parametrize("target", ["simulation", "all"])
def test_files_for_other_programs_are_written_where_a_scene_asks_for_them(small: Path, target: str) -> None:
    write_scene(small, "plain", "layers: [bones]")
    write_scene(
        small,
        "exported",
        "layers: [skin]\nobj: true\nrigged: true\nscan: true\nskeleton: true\nmechanics: true",
    )
    rules = planned(small, target, "--config", "subjects=[small]", "scenes=[plain,exported]")
    assert rules["export_scene"] == 2
    assert [rules[f"export_{kind}"] for kind in ("obj", "rigged", "scan", "skeleton", "mechanics")] == [1] * 5


@pytest.mark.parametrize(("asked", "movies"), [("", (1, 0)), ("images: true", (1, 1))])
def test_movies_are_made_where_a_scene_asks_for_them(
    small: Path, asked: str, movies: tuple[int, int]
) -> None:
    write_scene(small, "plain", "layers: [bones]")
    write_scene(small, "filmed", f"layers: [skin]\nmovie: true\n{asked}")
    rules = planned(small, "all", "--config", "subjects=[small]", "scenes=[plain,filmed]")
    assert (rules["render_movie"], rules.get("render_volumes", 0)) == movies


@pytest.mark.parametrize(("layers", "poses"), [("fat", 1), ("skin", 0)])
@pytest.mark.parametrize("target", ["simulation", "all"])
def test_the_neutral_image_is_moved_where_a_scene_asks_for_it(
    small: Path, target: str, layers: str, poses: int
) -> None:
    write_scene(small, "plain", "layers: [bones]")
    write_scene(small, "moved", f"layers: [{layers}]\nimages: true")
    rules = planned(small, target, "--config", "subjects=[small]", "scenes=[plain,moved]")
    assert rules["move_images"] == 1
    compared = poses if target == "all" else 0
    assert (rules.get("move_image", 0), rules.get("evaluate_images", 0)) == (compared, min(compared, 1))
    rules = planned(small, target, "--config", "subjects=[small]", "scenes=[plain]")
    assert not {"move_images", "move_image", "evaluate_images"} & set(rules)


def test_the_skin_is_made_once_for_fat_flesh_and_soft_tissue(nothing_built: Path) -> None:
    rules = planned(nothing_built, "all", "baselines")
    assert [rules[name] for name in ("make_skin", "mesh_fat", "mesh_flesh", "mesh_soft_tissue")] == [1] * 4


def changed(folder: Path, before: dict[str, int]) -> set[str]:
    return {path for path, time in artifact_times(folder).items() if before.get(path) != time}


def artifact_times(folder: Path) -> dict[str, int]:
    """When each file of the small subject's segmentation was written."""
    base = folder / "results" / "small" / "segmentation"
    return {p.relative_to(base).as_posix(): p.stat().st_mtime_ns for p in base.rglob("*") if p.is_file()}


def test_scribbles_rerun_their_bone_alone(built_small: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(built_small, tmp_path / "copy"))
    before = artifact_times(folder)
    drawn = np.where(seeds() == LABELS["far"], LABELS["far"], 0).astype(np.uint8)
    write_image(folder / "small" / "bent-far.nii.gz", drawn)
    assert planned(folder, "segmentation", *SMALL) == {
        "check_subject": 1,
        "correct_bone": 1,
        "merge_labels": 1,
        "evaluate_segmentation": 1,
        "segmentation": 1,
    }
    process = run(folder, "-j2", "segmentation", *SMALL)
    assert process.returncode == 0, process.stdout
    merged = {f"bent/{name}" for name in ("labels.nii.gz", "labels.json", "surfaces.h5", "looks.json")}
    assert changed(folder, before) == {"bent/corrected/far.h5", *merged}


def test_changed_scan_is_checked_but_images_stay(built_small: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(built_small, tmp_path / "copy"))
    write_mesh(folder / "small" / "bent.ply", ball().apply_scale(1.1))
    assert planned(folder, "segmentation", *SMALL) == {"check_subject": 1, "segmentation": 1}


SCOPES = {  # of the finger: what a scene names, and the bones that it models
    ("index",): ("metacarpal2", "proximal2", "middle2", "distal2"),
    ("distal2",): ("metacarpal2", "proximal2", "middle2", "distal2"),
    ("middle2",): ("metacarpal2", "proximal2", "middle2"),
    ("proximal2",): ("metacarpal2", "proximal2"),
}
ATTACHED = {  # in place of the attachments of the finger's muscles and ligaments
    "PIP2_radial": ("proximal2", "middle2"),
    "PIP2_ulnar": ("proximal2",),
    "lumbrical1": ("metacarpal2", "distal2"),
    "dorsal_interosseous1": ("metacarpal2", "proximal2"),
}


def plan_of_scope(bench: Workbench, only: Sequence[str], layers: Sequence[str]) -> JobPlan:
    """The plan of a scene of some bones of a person's finger."""
    bench.before("person")
    for organ, bones in ATTACHED.items():
        file = bench.folder / "person" / "templates" / f"{organ}.json"
        file.write_text(json.dumps({bone: [0] for bone in bones}), encoding="utf-8")
    joints = bench.contents["person"]["joints"].values()
    angles = [f"{a} [deg]" for j in joints if j["child"] in SCOPES[tuple(only)] for a in j["angles"]]
    frames = Path("config/scenes/scope.csv")
    (bench.folder / frames).write_text(f"frame,{','.join(angles)}\nrest{',0' * len(angles)}\n")
    scene = {"frames": str(frames), "layers": list(layers), "only": list(only)}
    bench.write("scenes/flexion", bench.contents["scene"] | scene)
    return bench.plan("person")


def segmented(found: JobPlan) -> set[str]:
    """The bones that the segmentation of every pose reads."""
    jobs = [str(compared) for job, compared in found.compared.items() if job.rule == "segment_pose"]
    return {bone for bone in SCOPES["index",] if all(f'"{bone}": {{"label"' in job for job in jobs)}


def members(found: JobPlan, rule: str, kind: str) -> set[str]:
    return {dict(job.wildcards)[kind] for job in found.compared if job.rule == rule}


@pytest.mark.parametrize("only", SCOPES, ids="-".join)
def test_a_scene_of_some_bones_builds_what_lies_on_them(bench: Workbench, only: tuple[str, ...]) -> None:
    found = plan_of_scope(bench, only, ("bones", "tendons", "ligaments", "muscles"))
    bones = set(SCOPES[only])
    on_bones = {organ for organ, attached in ATTACHED.items() if bones.issuperset(attached)}
    whole = len(bones) == 4
    assert segmented(found) == bones
    assert members(found, "fit_hooks", "tendon") == ({"flexor2", "extensor2"} if whole else set())
    fitted = members(found, "fit_ligament", "ligament") | members(found, "extract_muscle", "muscle")
    assert fitted == on_bones
    assert ("simulate_flesh" in found.rules()) == whole
    assert ("correct_bone" in found.rules()) == whole  # distal2 alone has scribbles


def test_a_scene_of_other_bones_segments_again(bench: Workbench) -> None:
    """Artifacts of both have the same paths."""
    first, second = (plan_of_scope(bench, (bone,), ("bones",)) for bone in ("middle2", "proximal2"))
    changed = {job.rule for job in second.changed(first)}
    assert {"segment_pose", "merge_labels", "register_bones", "fit_rig"} <= changed
    assert "check_subject" not in changed


@pytest.mark.parametrize("layer", ["fat", "skin"])
def test_skin_around_some_bones_is_refused_before_any_job(bench: Workbench, layer: str) -> None:
    with pytest.raises(WorkflowError, match=f"flexion.yaml: layers: {layer} is made of the skin around all"):
        plan_of_scope(bench, ("proximal2",), (layer,))


def test_other_bones_are_not_segmented(small: Path) -> None:
    """A third bone has strokes, in what is muscle in the image: they are known as its own, and left alone."""
    subject = yaml.safe_load((small / "config/datasets/small.yaml").read_text(encoding="utf-8"))
    subject["bones"]["end"] = {"label": 3, "template": "far.ply"}
    subject["joints"]["tip"] = {"parent": "far", "child": "end", "angles": [], "axis_hints": []}
    write_dataset(small, subject)
    drawn = seeds()
    drawn[:3, :3][drawn[:3, :3] == 255] = 3
    for pose in ("flat", "bent"):
        write_image(small / "small" / f"{pose}-seeds.nii.gz", drawn)
    write_scene(small, "part", "layers: [bones]\nonly: [far]")
    process = run(small, "-j2", "rig", "--config", "subjects=[small]", "scenes=[part]")
    assert process.returncode == 0, process.stdout
    for pose in ("flat", "bent"):
        surfaces = read_surfaces(small / "results/small/segmentation" / pose / "surfaces.h5", "marrow")
        assert set(surfaces) == set(LABELS)
    assert set(Rig.load(small / "results/small/rig.h5").bones) == set(LABELS)
