"""A sequence on a cluster: Slurm runs it by `profiles/slurm`; a killed worker costs one more job."""

import contextlib
import os
import shutil
import signal
import subprocess
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from textwrap import indent

import numpy as np
import pytest

from .running import ENVIRONMENT, command, planned, run
from .slurm_node import Node, absent_programs, slurm_node, wait_for
from .test_failed_frames import hinge_rig
from .test_resume import contents

COUNT, CHUNK, SLOW = 9, 3, "f4"  # frames, frames of a job, a frame in the middle of the second job
BUILD = (
    "results/small/simulation/complete.json",
    "results/small/metrics/frames-close.json",
    "--config",
    "subjects=[small]",
    "scenes=[close]",
    "--allowed-rules",
    *("simulate", "evaluate_frames", "export_scene", "require_simulation"),
)
ON_CLUSTER = (
    "--profile=profiles/slurm",
    "--slurm-status-command=squeue",  # the node has no accounting
    "--slurm-init-seconds-before-status-checks=2",
)
# At its first call the slow frame tells its process and waits to be killed.
CALL = "\n        simulate(\n"
WAITS = f"""
    import os, time
    from handpipe.skeleton.posing.layer import BoneLayer

    solve = BoneLayer.solve

    def slow(layer, frame, below):
        print(frame.name, file=open("solved.txt", "a", encoding="utf-8"))
        if frame.name == {SLOW!r} and not Path("process").exists():
            Path("written").write_text(str(os.getpid()), encoding="utf-8")
            Path("written").rename("process")
            time.sleep(300)
        return solve(layer, frame, below)

    BoneLayer.solve = slow
"""
pytestmark = pytest.mark.skipif(
    bool(absent_programs()), reason=f"this machine lacks {', '.join(absent_programs())}"
)


@pytest.fixture
def node() -> Iterator[Node]:
    with slurm_node(cpus=2) as found:
        yield found


def write_sequence(folder: Path) -> None:
    """A rig of the small subject, a scene of its bones in three chunks, and a frame that waits."""
    (folder / "results/small").mkdir(parents=True)
    with contextlib.chdir(folder):
        hinge_rig().save("results/small/rig.h5")
    rows = ["frame,hinge_flexion [deg]", *(f"f{i},{10 * i}" for i in range(COUNT)), ""]
    (folder / "config/scenes/close.csv").write_text("\n".join(rows), encoding="utf-8")
    (folder / "config/scenes/close.yaml").write_text(
        f"layers: [bones]\nchunk: {CHUNK}\nframes: config/scenes/close.csv\n", encoding="utf-8"
    )
    script = folder / "workflow/scripts/simulate.py"
    text = script.read_text(encoding="utf-8")
    script.write_text(text.replace(CALL, indent(WAITS, "    ") + CALL, 1), encoding="utf-8")


def build_and_kill_a_worker(folder: Path, node: Node) -> str:
    """Build on the cluster and kill the process of the slow frame; return what the build says."""
    said = folder / "said.txt"
    with open(said, "wb") as log:
        environment = {**ENVIRONMENT, **node.environment}
        build = subprocess.Popen(
            command([*BUILD, *ON_CLUSTER]), cwd=folder, env=environment, stdout=log, stderr=log
        )
        try:
            started = folder / "process"
            wait_for(lambda: started.exists() or build.poll() is not None, 200, "a slow frame")
            assert started.exists(), said.read_text(encoding="utf-8")
            os.kill(int(started.read_text(encoding="utf-8")), signal.SIGKILL)
            code = build.wait(timeout=300)
        finally:
            build.kill()
            build.wait()
    text = said.read_text(encoding="utf-8")
    assert code == 0, text
    return text


def test_a_killed_worker_costs_one_more_job_and_no_finished_frame(
    small: Path, tmp_path: Path, node: Node
) -> None:
    write_sequence(small)
    local = Path(shutil.copytree(small, tmp_path / "local"))
    (local / "process").touch()
    assert (done := run(local, "-j2", *BUILD)).returncode == 0, done.stdout

    said = build_and_kill_a_worker(small, node)
    # three chunks and the killed one again, evaluation and export as a group, the last job
    assert Counter(node.submissions().values()) == {"COMPLETED": 5, "FAILED": 1}, said
    solved = Counter((small / "solved.txt").read_text(encoding="utf-8").split())
    assert solved == {f"f{i}": 1 + (f"f{i}" == SLOW) for i in range(COUNT)}
    found, expected = contents(small), contents(local)
    assert found.keys() == expected.keys() and len(found) > COUNT
    for name, value in expected.items():
        np.testing.assert_equal(found[name], value, err_msg=name)
    assert planned(small, *BUILD) == {}
