"""Rules of a scene's movies, moved images, stresses, rig and OBJ files, run on the small subject."""

import json
import shutil
from pathlib import Path

import meshio
import nibabel
import numpy as np
import pygltflib
import pytest
import trimesh
from PIL import Image as images
from scipy.ndimage import map_coordinates

from .running import run, watching
from .small_subject import AFFINE, image

pytestmark = pytest.mark.slow

FRAMES = ("rest", "bent")
TABLE = "tables/frames-seen.json"
RULES = {
    "export_mechanics", "export_skeleton", "export_obj", "export_rigged", "export_scan", "find_equilibria",
    "move_images", "render_movie", "render_volumes",
}  # fmt: skip
SCENE = """layers: [skin]
frames: config/scenes/seen.csv
movie: true
images: true
mechanics: true
equilibria: true
rigged: true
scan: true
delta_mush: 3
skeleton: true
obj: true
"""


@pytest.fixture(scope="module")
def built(built_small: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A working copy where a scene of two frames is built with all that a scene can ask for."""
    folder = Path(shutil.copytree(built_small, tmp_path_factory.mktemp("seen") / "copy"))
    scenes = folder / "config" / "scenes"
    (scenes / "seen.csv").write_text("frame,hinge_flexion [deg]\nrest,0\nbent,15\n")
    (scenes / "seen.yaml").write_text(SCENE)
    (folder / "watched").mkdir()
    arguments = (
        "-j2",
        "simulation",
        f"results/small/{TABLE}",
        "--config",
        "subjects=[small]",
        "scenes=[seen]",
    )
    process = run(folder, *arguments, environment=watching(folder / "watched"))
    assert process.returncode == 0, process.stdout[-5000:]
    return folder


@pytest.fixture(scope="module")
def scene(built: Path) -> Path:
    return built / "results/small/simulation/seen"


def test_each_rule_ran_and_read_what_it_declares(built: Path) -> None:
    jobs = [json.loads(path.read_text(encoding="utf-8")) for path in (built / "watched").glob("*.json")]
    assert {job["rule"] for job in jobs} >= RULES
    assert [job for job in jobs if job["undeclared"]] == []


@pytest.mark.parametrize("name", ["seen", "seen-anatomy", "seen-fat"])
def test_movies_show_every_frame(scene: Path, name: str) -> None:
    with images.open(scene / f"{name}.webp") as movie:
        assert movie.n_frames == len(FRAMES)
        for number in range(len(FRAMES)):
            movie.seek(number)
            dark = (np.asarray(movie.convert("L")) < 240).mean()
            assert 0.01 < dark < 0.9


def test_the_image_of_the_frame_at_rest_is_the_neutral_image(scene: Path) -> None:
    moved = nibabel.load(scene / "images/frame-0000.nii.gz")
    values = moved.get_fdata()
    places = np.moveaxis(np.indices(values.shape), 0, -1) @ moved.affine[:3, :3].T + moved.affine[:3, 3]
    voxels = (places - AFFINE[:3, 3]) @ np.linalg.inv(AFFINE[:3, :3]).T
    own = map_coordinates(image(), np.moveaxis(voxels, -1, 0), order=1, mode="nearest")
    body = values > 0
    assert body.sum() > 20_000
    assert np.corrcoef(values[body], own[body])[0, 1] > 0.95
    bent = nibabel.load(scene / "images/frame-0001.nii.gz").get_fdata()
    assert bent.shape == values.shape and np.abs(bent - values).max() > 20
    for number in range(len(FRAMES)):
        with images.open(scene / f"images/frame-{number:04d}.png") as picture:
            assert picture.size[0] > 300


def test_the_body_is_stressed_where_it_is_bent(scene: Path) -> None:
    rest, bent = (meshio.read(scene / f"mechanics/skin/skin_mesh-{n:04d}.vtu") for n in range(2))
    stresses = [mesh.cell_data_dict["von_mises_stress"]["tetra"] for mesh in (rest, bent)]
    assert stresses[0].max() < 0.05 * stresses[1].max()
    assert stresses[1].max() > 0.01  # kPa


def test_the_rig_has_a_node_a_bone(scene: Path) -> None:
    document = pygltflib.GLTF2().load(str(scene / "seen-rigged.glb"))
    assert [document.nodes[joint].name for joint in document.skins[0].joints] == ["near", "far"]
    assert len(list((scene / "obj").glob("*.obj"))) == len(FRAMES)


def test_the_scan_moves_with_the_frames(built: Path, scene: Path) -> None:
    document = pygltflib.GLTF2().load(str(scene / "seen-scan.glb"))
    [mesh] = document.meshes
    assert mesh.extras["targetNames"] == list(FRAMES)
    [primitive] = mesh.primitives
    source = trimesh.load_mesh(built / "small/flat.ply", process=False)
    assert document.accessors[primitive.attributes.POSITION].count == len(source.vertices)
    moved = [document.accessors[target["POSITION"]].max for target in primitive.targets]
    assert max(moved[0]) < 1e-4 and max(moved[1]) > 1e-3  # m


def test_each_frame_says_whether_it_has_other_equilibria(built: Path) -> None:
    table = json.loads((built / "results/small" / TABLE).read_text(encoding="utf-8"))
    assert [(row["frame"], row["starts"], row["starts_without_result"]) for row in table] == [
        ("rest", 2, 0), ("bent", 2, 0),
    ]  # fmt: skip
    assert [row["other_equilibria"] for row in table] == [0, 0]  # one finger that is hardly bent
