"""Whether a tissue rests in the same shape from other starts: its folds can rest in several ways."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, ConvergenceError, Frame, Shapes, SimulatedFrame
from handpipe.tissues.fat.layer import TissueLayer

log = logging.getLogger(__name__)

SAME = 0.05  # mm; skins that are nearer are one equilibrium
BLEND = "blend of the bones"


@dataclass(frozen=True)
class Restart:
    """Where a tissue of a frame comes to rest from another start.

    Parameters
    ----------
    start : str
        The start: "blend of the bones", or the name of the frame whose shape it is.
    mean, largest : float
        Distance in mm of the skin's vertices from those of the frame; NaN where nothing was found.
    energy : float
        Elastic energy over that of the frame.
    settled : bool
        Whether its contact has settled.
    reason : str
        Why no equilibrium was found; empty where one was.
    """

    start: str
    mean: float = np.nan
    largest: float = np.nan
    energy: float = np.nan
    settled: bool = False
    reason: str = ""

    @property
    def other(self) -> bool:
        """Whether it is another equilibrium than the frame's: a settled one, more than 0.05 mm away."""
        return self.settled and self.largest > SAME


def restarts(
    layer: TissueLayer,
    frame: Frame,
    shapes: Mapping[str, Shapes],
    neighbours: Sequence[SimulatedFrame] = (),
) -> list[Restart]:
    """Simulate the outermost layer of a frame again, from the blend of the bones and from other frames.

    Parameters
    ----------
    layer : TissueLayer
        The outermost layer.
    frame : Frame
        A simulated frame.
    shapes : mapping of str to Shapes
        Its shapes by layer and body, those of the layer and of the layers below it.
    neighbours : sequence of SimulatedFrame
        Frames whose shapes of the layer are starts, too. They are carried to this frame by the bones.

    Returns
    -------
    list of Restart
        One a start, in this order.
    """
    tissue = layer.tissue
    starts = {BLEND: tissue.pose(frame.bones)}
    for other in neighbours:
        starts[other[0].name] = tissue.after(layer.name, other, frame.bones)
    return [_restarted(layer, frame, shapes, name, start) for name, start in starts.items()]


def _restarted(
    layer: TissueLayer, frame: Frame, shapes: Mapping[str, Shapes], name: str, start: Array
) -> Restart:
    tissue = layer.tissue
    try:
        found = layer.at_rest(frame, shapes, [start])
    except ConvergenceError as error:
        log.warning("%s of %s: no equilibrium is found; start: %s. %s", layer.name, frame.name, name, error)
        return Restart(name, reason=str(error))
    before = _tets_of(layer, shapes)
    apart = np.linalg.norm(tissue.skin_matrix @ (found.x - before), axis=1)
    elastic = tissue.strained(layer.plastic_strains(frame.bones))
    share = elastic.value(found.x) / elastic.value(before)
    restart = Restart(name, float(apart.mean()), float(apart.max()), float(share), found.rests)
    if restart.other:
        text = (
            "%s of %s: there is another equilibrium. Its skin is up to %.2f mm from the frame's, its elastic "
            "energy %.3f of the frame's; start: %s"
        )
        log.warning(text, layer.name, frame.name, restart.largest, restart.energy, name)
    return restart


def _tets_of(layer: TissueLayer, shapes: Mapping[str, Shapes]) -> Array:
    """Vertices (n, 3) in mm of the layer's tets."""
    return np.asarray(shapes[layer.name][f"{layer.name}_mesh"].vertices)
