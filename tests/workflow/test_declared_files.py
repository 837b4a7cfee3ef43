"""Jobs of rules that the finger does not have, watched as its are: they read what their rules declare.

Every rule of the workflow is watched in one of the two builds or in that of test_declared_truth.py, or named
here with the reason why it is not.
"""

import ast
import json
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import yaml

from handpipe.core import paths

from .running import CHECKOUT, planned, run, watching, working_copy
from .small_subject import (
    AFFINE,
    LABELS,
    POSES,
    RADIUS,
    SHAPE,
    SPACING,
    distance_to,
    image,
    seeds,
    write_image,
    write_mesh,
    write_subject,
)
from .thin_hand import TRUTH_RULES

RULES = sorted((CHECKOUT / "workflow" / "rules").glob("*.smk"))
NOT_WATCHED = {
    "zanatomy_hand": "90 s, with data of others: tests/synthetic/test_zanatomy_hand.py watches its stage",
    "sliding_body": "minutes of simulation: tests/synthetic/sliding watches its parts",
    "sliding_pose": "minutes of simulation: tests/synthetic/sliding watches its parts",
    "sliding_images": "minutes of simulation: tests/synthetic/sliding watches its parts",
    "evaluate_sliding": "minutes of simulation: tests/synthetic/sliding watches its parts",
    "learn_levels": "needs ten frames: test_levels.py watches it",
    "export_player": "shows learned frames: test_levels.py watches it",
    "animate": "shows learned frames: test_levels.py watches it",
    "animate_springs": "for scenes at level L2: test_levels.py watches it",
    "make_shard": "of random poses: test_shards.py watches it",
    "index_shards": "of random poses: test_shards.py watches it",
    "simulate_baselines": "after a whole build: test_build.py watches it",
    "evaluate_baselines": "after a whole build: test_build.py watches it",
    "mesh_ablated_fat": "after a whole build: tests/evaluation/test_ablations.py runs its stage",
    "simulate_ablated_inner": "as mesh_ablated_fat",
    "simulate_ablated_skin": "as mesh_ablated_fat",
    "evaluate_ablations": "as mesh_ablated_fat",
    "mesh_crease_tissue": "for scenes at level L3: test_levels.py watches it",
}
AIR = 4  # voxels around the small subject's image
WIDE = AFFINE + np.pad(np.full((3, 1), -AIR * SPACING), ((0, 1), (3, 0)))
ECHOES = (3.45, 4.60, 5.75)  # ms
SHIFT = -434.0  # Hz from water to fat at 3 T


def wide(values: np.ndarray) -> np.ndarray:
    return np.pad(values, AIR)


def inside() -> np.ndarray:
    """A finger of one piece, wider at one end and flat on one side: no turn maps it to itself."""
    x, y, z = np.indices(SHAPE)
    across = ((y - 14.5) / (13.5 - 0.05 * x)) ** 2 + ((z - 14.5) / (12.5 - 0.05 * x)) ** 2
    return (across < 1) & (z < 23) & (x > 0) & (x < SHAPE[0] - 1)


def in_air() -> np.ndarray:
    """The small subject's image; muscle is darker: in air, brighter muscle looks like marrow in its shell."""
    values = np.where(image() == 45, 20.0, image())
    return np.where(inside(), values, 1.0)


def hull(mask: np.ndarray) -> trimesh.Trimesh:
    """Convex surface around the voxels of a mask, finely triangulated."""
    found = trimesh.convex.convex_hull(np.argwhere(mask) * SPACING)
    return found.subdivide_to_size(2.0)


def write_echoes(folder: Path) -> list[dict[str, Any]]:
    """Echoes of water in the muscle and fat in the marrow, and what a dataset file says of them."""
    values = in_air()
    fat = values > 90
    noise = np.random.default_rng(0).uniform(-np.pi, np.pi, (len(ECHOES), *wide(values).shape))
    written = []
    for number, time in enumerate(ECHOES):
        signal = np.where(fat, np.exp(2j * np.pi * SHIFT * time / 1000), 1.0) * values
        names = {part: f"bent-{number}-{part}.nii.gz" for part in ("magnitude", "phase")}
        phase = np.where(wide(inside()), wide(np.angle(signal)), noise[number])
        write_image(folder / names["magnitude"], wide(np.abs(signal)).astype(np.float32), WIDE)
        write_image(folder / names["phase"], phase.astype(np.float32), WIDE)
        written.append({"time_ms": time, **names})
    return written


def write_scanned(folder: Path) -> dict[str, Any]:
    """The small subject in air: a skin of its volume, a scan in its own frame, echoes, a template.s hints."""
    dataset, data = write_subject(folder), folder / "small"
    for pose in POSES:
        write_image(data / f"{pose}.nii.gz", wide(in_air()).astype(np.float32), WIDE)
        write_image(data / f"{pose}-seeds.nii.gz", wide(seeds()), WIDE)
    write_image(data / "bent-far.nii.gz", wide(np.zeros(SHAPE, np.uint8)), WIDE)
    write_mesh(data / "bent.ply", hull(inside()))
    for bone in LABELS:
        write_mesh(data / f"{bone}.ply", hull(distance_to(bone) < RADIUS + 2))
    del dataset["poses"]["flat"]["scan"], dataset["muscles"]
    dataset["poses"]["bent"] |= {
        "scan_frame": "own",
        "dixon": {"field_T": 3.0, "echoes": write_echoes(data)},
    }
    return dataset | {"drawn_in": "template"}


def write_limb(folder: Path, scanned: dict[str, Any]) -> dict[str, Any]:
    """The same images as a folder of real ones."""
    strokes = {
        "bones": {"near": [[[13, 20, 20], [21, 20, 20]]], "far": [[[31, 20, 20], [39, 20, 20]]]},
        "outside": [[[2, 2, 2], [40, 2, 2]]],
    }
    (folder / "strokes.json").write_text(json.dumps(strokes), encoding="utf-8")
    poses = {
        pose: {"role": scanned["poses"][pose]["role"], "volume": f"volumes/{pose}.nii.gz"} for pose in POSES
    }
    poses["flat"]["seeds"] = "seeds/flat.nii.gz"
    limb = {"unit": 1.0, "volumes": {pose: f"{pose}.nii.gz" for pose in POSES}, "strokes": "strokes.json"}
    bones = {bone: {"label": label} for bone, label in LABELS.items()}
    given = {"name": "limb", "generator": "real-limb", "anatomy": "small", "limb": limb}
    return given | {"root": "results/limb/data", "poses": poses, "bones": bones, "joints": scanned["joints"]}


def write_unseeded(folder: Path, scanned: dict[str, Any]) -> dict[str, Any]:
    """The small subject without seeds in its second pose, and with a truth of its bones."""
    labels = sum(label * (distance_to(bone) < RADIUS) for bone, label in LABELS.items())
    for pose in POSES:
        write_image(folder / f"small/truth/{pose}.marrow.nii.gz", wide(labels.astype(np.uint8)), WIDE)
    kept = {name: scanned["poses"]["bent"][name] for name in ("role", "volume", "scan")}
    poses = {"flat": scanned["poses"]["flat"], "bent": kept}
    given = {name: value for name, value in scanned.items() if name != "drawn_in"}
    return given | {"name": "unseeded", "poses": poses, "truth": {"folder": "truth"}}


COARSE = {
    "name": "coarse",
    "like": "phantom-hand-seeded",
    "root": "results/coarse/data",
    "scanner": {"spacing": 1.2},
}
SCENE = {
    "layers": ["fat"],
    "frames": "config/scenes/moving.csv",
    **dict.fromkeys(("obj", "rigged", "scan", "skeleton", "mechanics", "deviations", "equilibria"), True),
    **dict.fromkeys(("movie", "images"), True),
}
KEYS = "key,time [frame],hinge_flexion [deg]\nflat,0,0\nbent,1,5\n"
TARGETS = [
    str(paths.at(pattern, subject=subject, pose=pose))
    for pattern, subject, pose in (
        (paths.ALIGNED_SCAN, "small", "bent"),
        (paths.DATA_SEEDS, "limb", "flat"),
        (paths.DATA_VOLUME, "limb", "flat"),
        (paths.DATA_SEEDS, "coarse", "neutral"),
        (paths.metrics_of("seeds"), "unseeded", "bent"),
    )
]
GIVEN = ("--config", "subjects=[small]", "scenes=[moving]", "fidelity=preview")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A working copy built with the rules that the finger's build has not."""
    folder = working_copy(tmp_path_factory.mktemp("declared") / "copy")
    scanned = write_scanned(folder)
    made = (scanned, write_limb(folder, scanned), write_unseeded(folder, scanned), COARSE)
    for content in made:
        text = yaml.safe_dump(content, sort_keys=False)
        (folder / f"config/datasets/{content['name']}.yaml").write_text(text, encoding="utf-8")
    (folder / "config/scenes/moving.yaml").write_text(yaml.safe_dump(SCENE), encoding="utf-8")
    (folder / "config/scenes/moving.csv").write_text(KEYS, encoding="utf-8")
    (folder / "watched").mkdir()
    process = run(folder, "-j2", "all", *TARGETS, *GIVEN, environment=watching(folder / "watched"))
    assert process.returncode == 0, process.stdout[-5000:]
    return folder


@pytest.fixture(scope="module")
def jobs(built: Path) -> list[dict[str, Any]]:
    """What each job read."""
    return [json.loads(path.read_text(encoding="utf-8")) for path in (built / "watched").glob("*.json")]


def test_jobs_read_no_file_that_their_rules_do_not_declare(jobs: list[dict[str, Any]]) -> None:
    assert [job for job in jobs if job["undeclared"]] == []


def rules() -> Iterator[str]:
    """Names of the rules that run a script."""
    for path in RULES:
        for text in re.split(r"^rule ", path.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
            if "    script:" in text:
                yield text.partition(":")[0]


def test_every_rule_is_watched_or_has_a_reason(jobs: list[dict[str, Any]], tmp_path: Path) -> None:
    """Benchmarks read what they compare: code, shared data and results of whole builds."""
    finger = set(planned(working_copy(tmp_path / "copy"), "all", "--forceall")) - {"all"}
    watched = finger | TRUTH_RULES | {job["rule"] for job in jobs}
    known = {rule for rule in rules() if not rule.startswith("benchmark_")}
    assert known - watched == set(NOT_WATCHED)


def test_stages_look_for_no_files_of_their_own() -> None:
    """Also those that are not watched: no stage lists a folder of results or builds the path of one."""
    stages = CHECKOUT / "src" / "handpipe" / "stages"
    looking = []
    for path in sorted(stages.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            named = isinstance(node, ast.ImportFrom) and "paths" in [alias.name for alias in node.names]
            listed = isinstance(node, ast.Attribute) and node.attr in ("glob", "rglob", "iterdir", "walk")
            if named or listed:
                looking.append(f"{path.relative_to(stages)}:{node.lineno}")
    assert [place for place in looking if not place.startswith("views/render_volumes.py")] == []


def test_the_report_of_snakemake_has_the_pictures_and_tables(built: Path, tmp_path: Path) -> None:
    """Each file that a rule marks is inside, as it is on disk, in its category."""
    file = tmp_path / "report.zip"
    process = run(built, "all", *GIVEN, "--report", str(file))
    assert process.returncode == 0, process.stdout[-5000:]
    with zipfile.ZipFile(file) as opened:
        inside = [Path(name) for name in opened.namelist() if "/raw/" in name]
        held = {path.name: opened.read(str(path)) for path in inside}
    results = built / "results/small"
    drawn = {path.name: path for path in results.rglob("*.png") if path.parent.name == "pictures"}
    shown = [f"{pose}-{kind}" for pose in POSES for kind in ("skin", "organs", "distance", "slices")]
    assert sorted(drawn) == sorted(f"{name}.png" for name in [*shown, "moving-skin", "moving-organs"])
    places = (
        "poses/bent/moved.png",
        *(f"simulation/moving/moving{kind}.webp" for kind in ("", "-anatomy", "-fat")),
        *(f"tables/{stage}.json" for stage in ("rig", "limits", "registration", "skin", "frames-moving")),
        "report.html",
    )
    for path in [*drawn.values(), *(results / place for place in places)]:
        assert held.get(path.name) == path.read_bytes(), path.name
