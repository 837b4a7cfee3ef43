"""Layers solved inside out, frame by frame; frames do not depend on one another (000 section 3, Fig. 5)."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable, Mapping, Sequence

from handpipe.config import AIDS
from handpipe.layers import Frame, Layer, Shapes

log = logging.getLogger(__name__)


def simulate_frame(
    frame: Frame, layers: Sequence[Layer], known: Mapping[str, Shapes] | None = None
) -> dict[str, Shapes]:
    """Shapes of organs by layer name, each layer from those below it.

    known: layers that are simulated already. Raises `ConvergenceError` from the layer that finds no
    equilibrium.
    """
    shapes: dict[str, Shapes] = dict(known or {})
    for layer in layers:
        if layer.name in shapes:
            continue
        start = time.perf_counter()
        shapes[layer.name] = layer.solve(
            frame, {name: shapes[name] for name in layer.needs if name in shapes}
        )
        log.info("frame %s: %s in %.1f s", frame.name, layer.name, time.perf_counter() - start)
    return {name: found for name, found in shapes.items() if name not in AIDS}


def simulate(frames: Iterable[Frame], layers: Sequence[Layer]) -> list[tuple[Frame, dict[str, Shapes]]]:
    """All frames; logs how far it is."""
    frames = list(frames)
    done = []
    start = time.perf_counter()
    for count, frame in enumerate(frames, start=1):
        done.append((frame, simulate_frame(frame, layers)))
        elapsed = time.perf_counter() - start
        log.info("%d of %d frames, %.0f s left", count, len(frames), elapsed / count * (len(frames) - count))
    return done
