"""A Slurm cluster of one node, this machine: munged, slurmctld and slurmd in a temporary folder.

The daemons are those of Debian's packages munge, slurmctld, slurmd and slurm-client. They run as the user who
tests, in the foreground, on free ports, without accounting and without control groups.
"""

import os
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from getpass import getuser
from pathlib import Path

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "srun", "squeue", "scancel")
MUNGE_FILES = ("key-file", "socket", "pid-file", "seed-file")
SYSTEM = os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin", "/sbin"])  # where Debian puts daemons
CONFIGURATION = """\
ClusterName=one
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerType=sched/builtin
MinJobAge=300
SlurmdParameters=config_overrides
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory=16000 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def absent_programs() -> list[str]:
    """Programs of Slurm and munge that this machine lacks."""
    return [name for name in PROGRAMS if shutil.which(name, path=SYSTEM) is None]


@dataclass(frozen=True)
class Node:
    """A running node; folder: its configuration and logs."""

    folder: Path

    @property
    def environment(self) -> dict[str, str]:
        """Variables by which clients find the node, those of its jobs too."""
        path = os.pathsep.join([str(self.folder / "bin"), SYSTEM])
        return {"SLURM_CONF": str(self.folder / "slurm.conf"), "PATH": path}

    def ask(self, *command: str) -> str:
        """What a client says; empty if it fails."""
        done = subprocess.run(
            command,
            env={**os.environ, **self.environment},
            capture_output=True,
            encoding="utf-8",
            check=False,
        )
        return done.stdout if done.returncode == 0 else ""

    def submissions(self) -> dict[str, str]:
        """State of every job that was submitted, by its number."""
        lines = self.ask("squeue", "--noheader", "--states=all", "--format=%i %T").splitlines()
        return dict(map(str.split, lines))


def write_srun(folder: Path) -> None:
    """The `srun` of jobs, which the executor calls without the variable SLURM_CONF."""
    program = folder / "bin" / "srun"
    program.parent.mkdir()
    lines = ("#!/bin/sh", f"export SLURM_CONF={folder}/slurm.conf", f'exec {shutil.which("srun")} "$@"', "")
    program.write_text("\n".join(lines), encoding="utf-8")
    program.chmod(0o755)


def free_ports(count: int) -> list[int]:
    with ExitStack() as stack:
        found = [stack.enter_context(socket.socket()) for _ in range(count)]
        for each in found:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in found]


def wait_for(condition: Callable[[], object], seconds: float, what: str) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"{what}: not after {seconds:.0f} s"
        time.sleep(0.1)


@contextmanager
def daemon(folder: Path, *command: str) -> Iterator[None]:
    """A program that runs until the end; what it says is in `folder`."""
    with open(folder / f"{command[0]}.log", "wb") as log:
        program = shutil.which(command[0], path=SYSTEM) or command[0]
        process = subprocess.Popen([program, *command[1:]], stdout=log, stderr=log)
        try:
            yield
        finally:
            process.terminate()
            try:
                process.wait(timeout=10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@contextmanager
def slurm_node(cpus: int) -> Iterator[Node]:
    """A node that runs `cpus` jobs of one thread side by side; its jobs are cancelled at the end."""
    with tempfile.TemporaryDirectory(prefix="slurm-") as name, ExitStack() as stack:
        folder, node = Path(name), Node(Path(name))
        for part in ("state", "spool"):
            (folder / part).mkdir()
        key = folder / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        text = CONFIGURATION.format(
            folder=folder,
            host=socket.gethostname().split(".")[0],
            user=getuser(),
            cpus=cpus,
            ports=free_ports(2),
        )
        (folder / "slurm.conf").write_text(text, encoding="utf-8")
        write_srun(folder)
        files = {option: f"munge.{option.split('-')[0]}" for option in MUNGE_FILES}
        options = [f"--{option}={folder / file}" for option, file in files.items()]
        stack.enter_context(daemon(folder, "munged", "--foreground", "--force", *options))
        wait_for((folder / "munge.socket").exists, 10, "munged")
        for each in ("slurmctld", "slurmd"):
            stack.enter_context(daemon(folder, each, "-D", "-f", str(folder / "slurm.conf")))
        wait_for(lambda: "idle" in node.ask("sinfo", "--noheader", "--format=%T"), 30, "an idle node")
        stack.callback(wait_for, lambda: not node.ask("squeue", "--noheader"), 30, "the end of jobs")
        stack.callback(node.ask, "scancel", f"--user={getuser()}")
        yield node
