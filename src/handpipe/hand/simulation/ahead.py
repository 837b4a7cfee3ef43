"""Layers of frames simulated ahead, in a process of its own, while those above them are.

The layers under the fat do not depend on the fat: where each frame starts from the one before, a frame takes
the longer of both times, and not their sum.
"""

from __future__ import annotations

import logging
import multiprocessing
import queue
import signal
from collections.abc import Callable, Iterator, Sequence
from logging.handlers import QueueHandler
from multiprocessing.connection import Connection

from handpipe.core import Frame, HandpipeError, Layer, SimulatedFrame, plain
from handpipe.hand.simulation.frame_by_frame import Attempt, attempts

Load = Callable[[], Sequence[Layer]]


def simulated_ahead(
    load: Load, frames: Sequence[Frame], before: SimulatedFrame | None = None, *, follow: bool = True
) -> Iterator[Attempt]:
    """What `attempts` gives, from another process that is one frame ahead of who asks.

    Its log lines appear with the frame that they are of.

    Parameters
    ----------
    load : callable
        Gives the layers. It is called in the other process, so that it must be importable there.
    frames, before, follow
        As in `attempts`.

    Yields
    ------
    SimulatedFrame or Failure
        The frames in their order.

    Raises
    ------
    HandpipeError
        Where layers cannot be loaded, with the text of that error.
    ChildProcessError
        If the process ends before the last frame, as where memory is short.
    """
    context = multiprocessing.get_context("spawn")  # a process that has used threads must not be forked
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(sender, load, frames, follow, before), daemon=True)
    process.start()
    sender.close()
    try:
        for frame in frames:
            try:
                result, records = receiver.recv()
            except EOFError:
                raise ChildProcessError(_ended(frame)) from None
            for record in records:
                logging.getLogger(record.name).handle(record)
            if isinstance(result, str):
                raise HandpipeError(result)
            yield result
    finally:
        process.terminate()
        process.join()
        receiver.close()


def _ended(frame: Frame) -> str:
    return f"the process that simulates ahead ended before {frame.name}; there may not be enough memory"


def _work(
    sender: Connection, load: Load, frames: Sequence[Frame], follow: bool, before: SimulatedFrame | None
) -> None:
    """Send each attempt, or why there is none, with the log's records of it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends who asks, which ends this process
    records: queue.SimpleQueue[logging.LogRecord] = queue.SimpleQueue()
    logging.basicConfig(
        level=logging.INFO, format="%(message)s", handlers=[QueueHandler(records)], force=True
    )
    try:
        for attempt in attempts(frames, load(), follow, before):
            sender.send((attempt, _taken(records)))
    except (BrokenPipeError, ConnectionResetError):
        return  # who asks is gone
    except Exception as error:
        sender.send((plain(error), _taken(records)))


def _taken(records: queue.SimpleQueue[logging.LogRecord]) -> list[logging.LogRecord]:
    return [records.get() for _ in range(records.qsize())]
