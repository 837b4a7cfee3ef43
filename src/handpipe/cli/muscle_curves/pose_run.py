"""The solve of a pose in a process of its own: the page stays alive, and can stop it."""

from __future__ import annotations

import multiprocessing
import signal
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from handpipe.anatomy.bending import BentLimb, Step, follow_bend
from handpipe.anatomy.templates import TissueMesh
from handpipe.cli.muscle_curves.asked_pose import AskedPose
from handpipe.core import plain
from handpipe.fem.elements import Material
from handpipe.mesh.surfaces import Surface


@dataclass(frozen=True, eq=False)
class Solve:
    """What a process needs to find the equilibrium of a pose."""

    tissue: TissueMesh
    bones: Mapping[str, Surface]
    materials: Mapping[str, Material]
    asked: AskedPose


class PoseRun:
    """A solve that runs, has failed, or has ended.

    Parameters
    ----------
    solve : Solve
        What is solved.
    ended : callable
        Gets the limb in its pose, and returns a sentence for the person. It runs in a thread of its own.
    """

    def __init__(self, solve: Solve, ended: Callable[[BentLimb], str]) -> None:
        context = multiprocessing.get_context("spawn")  # a process that has used threads must not be forked
        self._receiver, sender = context.Pipe(duplex=False)
        self._process = context.Process(target=_work, args=(sender, solve), daemon=True)
        self._ended = ended
        self.limb: BentLimb | None = None
        self._state: dict[str, Any] = {"state": "running", "step": 0, "steps": solve.asked.bend.steps}
        self._process.start()
        sender.close()
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def state(self) -> dict[str, Any]:
        """`state` is "running", "failed" or "done"; the last step, and what is said of the end."""
        return dict(self._state)

    def stop(self) -> None:
        """End the process, if it still runs."""
        self._process.terminate()
        self._process.join()
        self._listener.join()

    def _listen(self) -> None:
        try:
            while self._state["state"] == "running":
                self._take(self._receiver.recv())
        except (EOFError, OSError):  # killed, as where memory is short
            said = "the solve ended without a result; there may not be enough memory for so many tets"
            self._state = {**self._state, "state": "failed", "said": said}
        self._receiver.close()
        self._process.join()

    def _take(self, message: Step | BentLimb | str) -> None:
        """What the process sent: a step, the end, or why there is none."""
        if isinstance(message, Step):
            told = {"step": message.number, "steps": message.steps, "residual": message.residual}
            self._state = {**self._state, **told, "degrees": float(np.degrees(message.angle))}
        elif isinstance(message, BentLimb):
            try:
                said = self._ended(message)
            except Exception as error:
                self._state = {**self._state, "state": "failed", "said": plain(error)}
                return
            self.limb = message
            self._state = {**self._state, "state": "done", "said": said}
        else:
            self._state = {**self._state, "state": "failed", "said": message}


def _work(sender: Connection, solve: Solve) -> None:
    """Solve, and send each step and the end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the server, which ends this process
    try:
        asked = solve.asked
        limb = follow_bend(solve.tissue, solve.bones, asked.pairs, solve.materials, asked.bend, sender.send)
        sender.send(limb)
    except Exception as error:
        sender.send(plain(error))
