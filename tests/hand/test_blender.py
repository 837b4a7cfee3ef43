"""The rigged glTF as Blender plays it. Blender is under the GPL: it is no dependency, and may be absent."""

import numpy as np
import pytest
from tests.hand.test_rigged import BONES, chain, frames

from handpipe.hand.exports.rigged_glb import write_rigged_glb

bpy = pytest.importorskip("bpy", reason="Blender as a module (bpy) is not installed", exc_type=ImportError)
FPS = 10


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory):
    """The frames, and Blender's scene of them."""
    path, rig = tmp_path_factory.mktemp("blender") / "hand.glb", chain()
    made = frames(rig)
    write_rigged_glb(path, rig, made, fps=FPS)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = FPS
    bpy.ops.import_scene.gltf(filepath=str(path))
    return made


def shown(name: str) -> np.ndarray:
    """Vertices (n, 3) in mm of the mesh of a name as Blender shows it in the current frame."""
    [found] = [o for o in bpy.data.objects if o.type == "MESH" and o.name.partition(".")[0] == name]
    evaluated = found.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    points = np.array([evaluated.matrix_world @ vertex.co for vertex in mesh.vertices])
    evaluated.to_mesh_clear()
    return 1e3 * points


def test_it_has_the_skeleton(opened) -> None:
    [armature] = [found for found in bpy.data.objects if found.type == "ARMATURE"]
    assert set(BONES) <= {bone.name for bone in armature.data.bones}


def test_its_frames_are_the_simulated_ones(opened) -> None:
    """Skin with corrective shapes, and a bone, in Blender's axes: z up, metres."""
    for number, (_, layers) in enumerate(opened):
        bpy.context.scene.frame_set(number)
        for layer, body in (("fat", "skin"), ("bones", "tip"), ("tendons", "flexor")):
            np.testing.assert_allclose(shown(f"{layer}/{body}"), layers[layer][body].vertices, atol=1e-3)


def test_without_correctives_they_are_not(opened) -> None:
    """The comparison can fail: skin weights alone do not give the frames."""
    [skin] = [o for o in bpy.data.objects if o.type == "MESH" and o.name.startswith("fat/skin")]
    skin.data.shape_keys.animation_data_clear()
    for key in skin.data.shape_keys.key_blocks:
        key.value = 0.0
    bpy.context.scene.frame_set(2)
    assert np.abs(shown("fat/skin") - opened[2][1]["fat"]["skin"].vertices).max() > 1.0
