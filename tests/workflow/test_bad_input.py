"""What a person gives wrongly ends a build with one message that names file and field, and leaves nothing."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml

from handpipe.core.configuration.dataset import load_dataset
from handpipe.core.errors import HandpipeError, InputError
from handpipe.hand.checks import faults

from .running import run
from .small_subject import ball, body, image, opened, seeds, write_dataset, write_image, write_mesh

SMALL = ("--config", "subjects=[small]")
SEGMENT = "results/small/segmentation/bent/bones.h5"
MERGE = "results/small/segmentation/bent/labels.nii.gz"
SIMULATE = "results/small/simulation/flexion/flexion.glb"
FAT = "results/small/fat/strains.h5"
SCAN = "results/small/simulation/flexion/flexion-scan.glb"
SOFT = "results/small/soft_tissue/mesh.h5"
DATASET = "config/datasets/small.yaml"


def edit(folder: Path, change: Callable[[dict], object]) -> None:
    """Change the dataset file's content."""
    content = yaml.safe_load((folder / DATASET).read_text(encoding="utf-8"))
    change(content)
    write_dataset(folder, content)


def missing_volume(folder: Path) -> None:
    (folder / "small" / "bent.nii.gz").unlink()


def missing_scan(folder: Path) -> None:
    (folder / "small" / "bent.ply").unlink()


def missing_regions(folder: Path) -> None:
    edit(folder, lambda d: d.update(regions={"bone_fascia": "painted.json"}))


def no_scan_of_an_example(folder: Path) -> None:
    edit(folder, lambda d: (d["poses"]["bent"].pop("scan"), d.update(skin_from_volume=False)))


def no_scan_of_neutral(folder: Path) -> None:
    edit(folder, lambda d: (d["poses"]["flat"].pop("scan"), d.update(skin_from_volume=False)))


def unknown_pose(folder: Path) -> None:
    """Nothing is spoilt: the target itself names a pose that is not there."""


def no_seeds_of_neutral(folder: Path) -> None:
    edit(folder, lambda d: d["poses"]["flat"].pop("seeds"))


def no_seeds_of_a_bone(folder: Path) -> None:
    labels = seeds()
    write_image(folder / "small" / "bent-seeds.nii.gz", np.where(labels == 1, 0, labels))


def damaged_volume(folder: Path) -> None:
    path = folder / "small" / "bent.nii.gz"
    data = path.read_bytes()
    path.write_bytes(data[:200] + bytes(100) + data[300:])


def one_grey(folder: Path) -> None:
    write_image(folder / "small" / "bent.nii.gz", np.full_like(image(), 7))


def seeds_of_another_grid(folder: Path) -> None:
    write_image(folder / "small" / "bent-seeds.nii.gz", seeds()[..., 1:])


def seeds_of_no_bone(folder: Path) -> None:
    labels = seeds()
    write_image(folder / "small" / "bent-seeds.nii.gz", np.where(labels == 1, 9, labels))


def scribbles_of_no_bone(folder: Path) -> None:
    edit(folder, lambda d: d["poses"]["bent"].update(scribbles={"thumb": "bent-far.nii.gz"}))


def not_a_number(folder: Path) -> None:
    values = image()
    values[3, 4, 5] = np.nan
    write_image(folder / "small" / "bent.nii.gz", values)


def scan_in_metres(folder: Path) -> None:
    write_mesh(folder / "small" / "bent.ply", ball().apply_scale(1e-3))


def scan_in_centimetres(folder: Path) -> None:
    write_mesh(folder / "small" / "bent.ply", body().apply_scale(0.1))


def scan_with_island(folder: Path) -> None:
    island = trimesh.creation.icosphere(subdivisions=2, radius=4.0).apply_translation([60, 0, 0])
    write_mesh(folder / "small" / "bent.ply", trimesh.util.concatenate([body(), island]))


def lost_texture(folder: Path) -> None:
    text = body().export(file_type="obj")
    (folder / "small" / "flat.obj").write_text(f"mtllib lost.mtl\n{text}")
    edit(folder, lambda d: d["poses"]["flat"].update(scan="flat.obj"))
    scenes = folder / "config" / "scenes"
    (scenes / "flexion.csv").write_text("frame,hinge_flexion [deg]\nbent,5\n")
    (scenes / "flexion.yaml").write_text("layers: [skin]\nframes: config/scenes/flexion.csv\nscan: true\n")


def muscle_in_centimetres(folder: Path) -> None:
    write_mesh(folder / "small" / "flexor.ply", ball().apply_translation([60, 0, 0]).apply_scale(0.1))
    for bone in ("near", "far"):
        write_mesh(folder / "small" / f"{bone}.ply", ball().apply_translation([60, 0, 0]))


def scan_with_nan(folder: Path) -> None:
    mesh = ball()
    vertices = mesh.vertices.copy()
    vertices[7, 1] = np.nan
    write_mesh(folder / "small" / "bent.ply", trimesh.Trimesh(vertices, mesh.faces, process=False))


def open_bone(folder: Path) -> None:
    write_mesh(folder / "small" / "far.ply", opened(ball()))


def open_muscle(folder: Path) -> None:
    write_mesh(folder / "small" / "flexor.ply", opened(ball()))


def unknown_bone(folder: Path) -> None:
    (folder / "small" / "flexor.json").write_text(json.dumps({"near": [0, 1, 2], "thumb": [3, 4, 5]}))


def unknown_child(folder: Path) -> None:
    edit(folder, lambda d: d["joints"]["hinge"].update(child="thumb"))


def unknown_layer(folder: Path) -> None:
    text = "layers: [bones, nerves]\nframes: config/scenes/flexion.csv\n"
    (folder / "config/scenes/flexion.yaml").write_text(text)


def beyond_limit(folder: Path) -> None:
    (folder / "config/scenes/flexion.csv").write_text("frame,hinge_flexion [deg]\nrest,0\nfar,95\n")


def no_frames(folder: Path) -> None:
    (folder / "config/scenes/flexion.csv").write_text("frame,hinge_flexion [deg]\n")


def braces(folder: Path) -> None:
    (folder / "small").rename(folder / "small {left}")
    edit(folder, lambda d: d.update(root="small {left}"))


# What is wrong, what is asked for, and the file, field and problem that the message names.
RUNS = [
    (missing_volume, SEGMENT, (DATASET, "poses.bent.volume", "small/bent.nii.gz does not exist")),
    (no_seeds_of_neutral, SEGMENT, (DATASET, "poses.flat", "the neutral pose needs seeds")),
    (no_seeds_of_a_bone, SEGMENT, ("small/bent-seeds.nii.gz", "seeds", "bone 'near' (label 1) has none")),
    (damaged_volume, SEGMENT, ("small/bent.nii.gz", "content", "cannot be read as NIfTI")),
    (not_a_number, SEGMENT, ("small/bent.nii.gz", "values", "1 voxels are NaN")),
    (scan_in_metres, "segmentation", ("small/bent.ply", "units", "looks like metres")),
    (unknown_bone, "segmentation", ("small/flexor.json", "thumb", "is not a bone of the dataset")),
    (unknown_layer, SIMULATE, ("config/scenes/flexion.yaml", "layers", "'nerves' is not a layer")),
    (no_frames, SIMULATE, ("config/scenes/flexion.csv", "rows", "there are none")),
    (
        beyond_limit,
        SIMULATE,
        ("config/scenes/flexion.csv", "row 3 (frame far), hinge_flexion", "outside its limits"),
    ),
    (
        no_scan_of_an_example,
        FAT,
        (DATASET, "poses.bent.scan", "is not given, but the layer fat is made of it"),
    ),
    (no_scan_of_neutral, FAT, (DATASET, "poses.flat.scan", "is not given, but the layer skin is made of it")),
    (
        no_scan_of_neutral,
        SOFT,
        (DATASET, "poses.flat.scan", "is not given, but the layer skin is made of it"),
    ),
    (lost_texture, SCAN, ("small/flat.obj", "texture", "names lost.mtl, which does not exist")),
    (unknown_pose, SEGMENT.replace("bent", "fist"), (DATASET, "poses.fist", "is not a pose")),
]


def built(folder: Path) -> set[str]:
    """Files of the results but logs and benchmarks; hidden ones, as temporary files are, too."""
    files = {p.relative_to(folder).as_posix() for p in (folder / "results").rglob("*") if p.is_file()}
    return {f for f in files if not f.startswith(("results/small/logs", "results/small/benchmarks"))}


def assert_one_message(folder: Path, target: str, source: str, field: str, problem: str) -> None:
    """Ask for a target that cannot be made: one message says why, and nothing is left but the check."""
    before = built(folder)
    process = run(folder, "-j1", target, *SMALL)
    assert process.returncode != 0
    said = [line for line in process.stdout.splitlines() if "handpipe: " in line]
    assert len(said) == 1, process.stdout
    assert f"{source}: {field}: " in said[0]
    assert problem in said[0]
    assert "Traceback (most recent call last)" not in process.stdout
    assert built(folder) - before <= {"results/small/check.json"}


@pytest.mark.parametrize(
    ("spoil", "target", "named"), RUNS, ids=[f"{spoil.__name__}-{target}" for spoil, target, _ in RUNS]
)
def test_run_ends_with_one_message(
    small: Path, spoil: Callable[[Path], None], target: str, named: tuple[str, str, str]
) -> None:
    spoil(small)
    assert_one_message(small, target, *named)


def test_mistakes_in_files_of_other_subjects_and_scenes_stop_nothing(small: Path) -> None:
    others = {"syntax": "poses: [", "list": "- a", "fields": "name: fields\nposes: 3\n"}
    for name, content in others.items():
        for folder in ("datasets", "scenes"):
            (small / "config" / folder / f"{name}.yaml").write_text(content)
    process = run(small, "-n", SEGMENT, *SMALL)
    assert process.returncode == 0
    for name in others:
        assert f"handpipe: {name} has no rules: config/datasets/{name}.yaml: " in process.stdout


def test_a_subject_without_its_source_data_is_skipped_and_named_once(small: Path) -> None:
    said = run(small, "all", "-n", "--config", "subjects=[small,zanatomy-hand-preview]", "scenes=[]")
    assert said.returncode == 0, said.stdout
    lines = [line for line in said.stdout.splitlines() if "is skipped" in line]
    assert len(lines) == 1 and "zanatomy-hand-preview is skipped: its anatomy" in lines[0]


def test_a_build_of_skipped_subjects_alone_is_refused(small: Path) -> None:
    said = run(small, "all", "-n", "--config", "subjects=[zanatomy-hand-preview]", "scenes=[]")
    assert said.returncode != 0
    assert "subjects: the anatomy of every subject is absent" in said.stdout


def test_truncated_artifact(built_small: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(built_small, tmp_path / "copy"))
    path = folder / SEGMENT
    path.write_bytes(path.read_bytes()[:200])
    assert_one_message(folder, MERGE, SEGMENT, "content", "cannot be read as HDF5")
    assert not (folder / MERGE).exists()  # nothing that was made of the artifact passes for up to date


# What the rules' own functions say, without a run for each.
CHECKS = [
    (scan_in_metres, "small/bent.ply", "units", "looks like metres"),
    (scan_in_centimetres, "small/bent.ply", "frame", "overlaps the body in the pose's image"),
    (scan_with_island, "small/bent.ply", "parts", "1 of 2 parts touch no other"),
    (muscle_in_centimetres, "small/flexor.ply", "frame", "attaches to far, but is"),
    (scan_with_nan, "small/bent.ply", "vertices", "NaN or infinite coordinates in 1 vertices"),
    (open_bone, "small/far.ply", "triangles", "is open"),
    (open_muscle, "small/flexor.ply", "triangles", "is open"),
    (unknown_bone, "small/flexor.json", "thumb", "is not a bone of the dataset"),
    (unknown_child, DATASET, "joints.hinge", "names the bone 'thumb'"),
    (braces, DATASET, "poses.flat.volume", "has braces in its name"),
    (missing_scan, DATASET, "poses.bent.scan", "small/bent.ply does not exist"),
    (damaged_volume, "small/bent.nii.gz", "content", "cannot be read as NIfTI"),
    (not_a_number, "small/bent.nii.gz", "values", "1 voxels are NaN"),
    (one_grey, "small/bent.nii.gz", "values", "is 7 everywhere"),
    (seeds_of_another_grid, "small/bent-seeds.nii.gz", "grid", "40 x 30 x 29 voxels of 0.8 x 0.8 x 0.8 mm"),
    (seeds_of_no_bone, "small/bent-seeds.nii.gz", "seeds", "bone 'near' (label 1) has none"),
    (scribbles_of_no_bone, DATASET, "poses.bent.scribbles", "names the bone 'thumb'"),
    (missing_regions, DATASET, "regions.bone_fascia", "small/painted.json does not exist"),
]


@pytest.mark.parametrize(
    ("spoil", "source", "field", "problem"), CHECKS, ids=[spoil.__name__ for spoil, *_ in CHECKS]
)
def test_check_names_file_and_field(
    small: Path,
    monkeypatch: pytest.MonkeyPatch,
    spoil: Callable[[Path], None],
    source: str,
    field: str,
    problem: str,
) -> None:
    monkeypatch.chdir(small)
    spoil(small)
    fault, *others = found_faults()
    assert not others or spoil is braces  # in the folder's name, and so in every file's path
    assert isinstance(fault, InputError)
    assert (fault.source, fault.field) == (source, field)
    assert problem in fault.problem


def found_faults() -> list[HandpipeError]:
    """What `handpipe check` says of the subject."""
    try:
        dataset = load_dataset(DATASET)
    except InputError as error:
        return [error]
    return faults(DATASET, dataset)


def test_all_faults_of_all_files_are_found_at_once(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(small)
    together = [scan_with_island, open_muscle, open_bone, seeds_of_no_bone, missing_regions]
    for spoil in together:
        spoil(small)
    found = found_faults()
    expected = {(source, field) for spoil, source, field, _ in CHECKS if spoil in together}
    assert len(found) == len(together)
    assert {(fault.source, fault.field) for fault in found if isinstance(fault, InputError)} == expected


def test_a_scan_in_its_own_frame_need_not_lie_in_the_image(
    small: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(small)
    write_mesh(small / "small" / "bent.ply", body().apply_translation([300.0, 0.0, 0.0]))
    [fault] = found_faults()
    assert isinstance(fault, InputError)
    assert (fault.source, fault.field) == ("small/bent.ply", "frame")
    assert "scan_frame: own" in fault.remedy
    edit(small, lambda d: d["poses"]["bent"].update(scan_frame="own"))
    assert found_faults() == []


def test_checks_find_nothing_in_a_good_subject(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(small)
    assert found_faults() == []
