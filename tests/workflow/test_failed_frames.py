"""A frame that fails is named; the others are exported; the next build simulates the failed frame alone."""

import contextlib
import json
from pathlib import Path
from textwrap import indent

import numpy as np
import pygltflib

from handpipe.core import metrics
from handpipe.core.rigid import RigidTransform
from handpipe.hand.frames import read_frames
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.joint_tree import FittedPose, RigJoint
from handpipe.skeleton.joints.joints import JointFit
from handpipe.skeleton.joints.residual import Residual
from handpipe.skeleton.rig.rig import Rig

from .running import planned, run
from .small_subject import ball

METRICS = "results/small/metrics/frames-close.json"
BUILD = ("-j2", "simulation", METRICS, "--config", "subjects=[small]", "scenes=[close]")
RULES = (
    "check_subject",
    "simulate",
    "evaluate_frames",
    "export_scene",
    "export_obj",
    "require_simulation",
    "simulation",
)
BAD = "a {bad}/../ö"
CALL = "\n        simulate(\n"
FAILS = f"""
    import handpipe.stages.hand.simulate as stage_module
    from handpipe.skeleton.posing.layer import BoneLayer
    from handpipe.core.errors import ConvergenceError

    class Picky(BoneLayer):
        def solve(self, frame, below):
            print(frame.name, file=open("solved.txt", "a", encoding="utf-8"))
            if frame.name == {BAD!r} and not Path("repaired").exists():
                raise ConvergenceError("Tendon x", "no luck")
            shapes = super().solve(frame, below)
            shapes["far"].figures["inverted_tets"] = 3.0 * (frame.name == "end")
            return shapes

    stage_module.load_layers = lambda names, dataset, files, bones, roles: [Picky(bones)]
"""


def hinge_rig() -> Rig:
    """The small subject's two bones as balls, with a hinge about y."""
    balls = {n: Surface(ball().vertices + [x, 0, 0], ball().faces) for n, x in (("near", 0), ("far", 20))}
    limits = np.radians([[-10.0, 90.0]])
    still = Residual(np.zeros((2, 3)), *limits.T)
    fit = JointFit(
        Axes(np.array([[0.0, 1, 0]]), (0,)), np.array([10.0, 0, 0]), still, still, np.zeros((0, 1))
    )
    joint = RigJoint("hinge", "near", "far", ("hinge_flexion",), limits, fit)
    poses = {
        n: FittedPose(RigidTransform.identity(), {"hinge_flexion": a})
        for n, a in (("flat", 0.0), ("bent", 0.5))
    }
    return Rig("near", (joint,), balls, poses)


def build(folder: Path) -> tuple[int, list[str], list[str]]:
    """Exit code, what the project says, and the frames that were simulated."""
    solved = folder / "solved.txt"
    solved.unlink(missing_ok=True)
    process = run(folder, *BUILD, "--allowed-rules", *RULES)
    said = [line for line in process.stdout.splitlines() if line.startswith("handpipe: ")]
    assert "Traceback" not in process.stdout, process.stdout
    names = solved.read_text(encoding="utf-8").split("\n")[:-1] if solved.exists() else []
    return process.returncode, said, sorted(names)


def test_a_failed_frame_is_named_left_out_and_simulated_again(small: Path) -> None:
    small = small.rename(small.with_name("Hände {x} [1] 'copy'"))
    with contextlib.chdir(small):  # an artifact records its place in the project
        hinge_rig().save("results/small/rig.h5")
    scenes, base = small / "config/scenes", small / "results/small/simulation/close"
    (scenes / "Häm [1].csv").write_text(
        f"frame,hinge_flexion [deg]\nrest,0\n{BAD},40\nend,80\nafter,30\n", encoding="utf-8"
    )
    (scenes / "close.yaml").write_text(
        "layers: [bones]\nchunk: 3\nobj: true\nframes: config/scenes/Häm [1].csv\n", encoding="utf-8"
    )
    script = small / "workflow/scripts/simulate.py"
    text = script.read_text(encoding="utf-8")
    script.write_text(text.replace(CALL, indent(FAILS, "    ") + CALL, 1), encoding="utf-8")

    code, said, solved = build(small)
    assert code != 0 and solved == sorted(["rest", BAD, "end", "after"])
    reason = f"frame {BAD}: bones: Tendon x did not converge: no luck."
    assert said[-1].startswith(f"handpipe: require_simulation: 1 frames were not simulated: {reason}")
    document = pygltflib.GLTF2().load(str(base / "close.glb"))
    assert document.meshes[0].extras["targetNames"] == ["rest", "end", "after"]
    assert len([*base.glob("obj/*.obj")]) == len([*base.glob("vtk/bones/far-*.vtu")]) == 3
    assert not (small / "results/small/simulation/complete.json").exists()

    found = metrics.read(small / METRICS)
    assert (found["bones_inverted_tets"], found["frames_failed"]) == ((3.0, "tets"), (1.0, "frames"))
    rows = json.loads((small / "results/small/tables/frames-close.json").read_text(encoding="utf-8"))
    assert [row.get("bones_inverted_tets") for row in rows] == [0.0, None, 3.0, 0.0]
    assert (rows[1]["failed"], rows[2]["angle"]) == ("bones", "hinge_flexion") and rows[2]["beyond"] > 51

    again = planned(small, *BUILD, "--allowed-rules", *RULES)  # nothing has changed: no success
    assert (again["simulate"], again["require_simulation"]) == (1, 1)

    (small / "repaired").touch()
    assert build(small) == (0, [], [BAD])
    assert metrics.read(small / METRICS)["frames_failed"] == (0.0, "frames")
    frames = [f.name for c in range(2) for f, _ in read_frames(base / f"frames-{c}.h5")]
    assert frames == ["rest", BAD, "end", "after"] and not [*base.glob("partial-*")]
    names = pygltflib.GLTF2().load(str(base / "close.glb")).meshes[0].extras["targetNames"]
    assert names == frames
    assert planned(small, *BUILD, "--allowed-rules", *RULES) == {}
