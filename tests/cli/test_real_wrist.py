"""A wrist of real bone shapes from `init` to its bent skin: bones that the images cut at both ends.

Six bones at 0.8 mm; `python -m benchmarks.scans.wrist` has fifteen, more poses and finer voxels.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest
from benchmarks.scans.real_wrist import SOURCE, Wrist
from benchmarks.scans.wrist import inverted_tets, rig_errors, skin_errors

from handpipe.cli import main
from handpipe.core import Frame, Layer
from handpipe.core.configuration import Dataset, load_dataset, load_scene
from handpipe.hand import simulate_frame
from handpipe.skeleton.motion import expand_motion
from handpipe.skeleton.posing import BoneLayer
from handpipe.skeleton.rig import Rig
from handpipe.stages.tissues import extract_skin, make_skin, mesh_soft_tissue
from handpipe.tissues.fat import Skin, load_skin

from .built import to_the_rig

NAME = "my-wrist"
BONES = ("radius", "ulna", "scaphoid", "lunate", "capitate", "metacarpal3")
POSES = ("neutral", "flexed", "deviated")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not SOURCE.exists(), reason="the shared anatomy is not beside the checkout"),
]


@pytest.fixture(scope="module")
def wrist() -> Wrist:
    return Wrist(SOURCE, BONES)


@pytest.fixture(scope="module")
def project(wrist: Wrist, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A project with the scans of a wrist, and what `init` writes for them; the working folder."""
    folder = tmp_path_factory.mktemp("real")
    (folder / "Snakefile").touch()
    wrist.write(folder / "mine", POSES, 0.8)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["init", NAME, "--volumes", "mine", "--hand", "right", *wrist.asked]) == 0
        assert main(["check", NAME]) == 0
        yield folder


@pytest.fixture(scope="module")
def built(project: Path) -> tuple[Dataset, Rig]:
    dataset = load_dataset(f"config/datasets/{NAME}.yaml")
    return dataset, to_the_rig(dataset, project / "built")


def test_bones_are_where_they_were(wrist: Wrist, built: tuple[Dataset, Rig]) -> None:
    """Two ball joints in a chain, and bones that move as one; the borders cut three of six bones."""
    errors = rig_errors(wrist, built[1])
    assert {pose for pose, _ in errors} == {*POSES[1:]} and len(errors) == 2 * len(BONES)
    for turn, shift in errors.values():
        assert turn < 1.0 and shift < 0.2


def test_the_scene_moves_through_the_poses_and_the_skin_follows(
    wrist: Wrist, built: tuple[Dataset, Rig], project: Path
) -> None:
    dataset, rig = built
    folder = project / "built"
    image = dataset.path(dataset.poses["neutral"].volume)
    files = {name: folder / name for name in ("skin.ply", "skin.json", "skin.h5", "tissue.h5")}
    extract_skin.extract_skin(
        extract_skin.Inputs(image, folder / "rig.h5"),
        extract_skin.Outputs(files["skin.ply"], files["skin.json"]),
        *(dataset, "neutral"),
    )
    make_skin.make_skin(make_skin.Inputs(files["skin.ply"], ()), files["skin.h5"], dataset, 4.0)
    mesh_soft_tissue.mesh_soft_tissue(
        mesh_soft_tissue.Inputs(folder / "rig.h5", files["skin.h5"]), files["tissue.h5"], dataset, 6.0
    )
    layers: list[Layer] = [BoneLayer(rig.surfaces), load_skin([files["tissue.h5"]], rig.surfaces)]
    frames = expand_motion(load_scene(f"config/scenes/{NAME}.yaml").frames, rig).frames
    unbent = Skin.load(files["skin.h5"]).surface.vertices
    for pose in POSES[1:]:
        shapes = simulate_frame(Frame(pose, frames[pose], rig.bone_transforms(frames[pose])), layers)["skin"]
        assert inverted_tets(shapes) == 0
        after = skin_errors(wrist, rig, pose, unbent, shapes["skin"].vertices)
        before = skin_errors(wrist, rig, pose, unbent, unbent)
        assert after.mean() < 1.0 and after.mean() < 0.65 * before.mean()
