"""Layers of a subject with the structures of real limbs that its phantom does not have."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from handpipe.synthetic.acquisition.image import VoxelGrid
from handpipe.synthetic.acquisition.physics.anatomy import ImagedAnatomy, Layer
from handpipe.synthetic.acquisition.physics.bones import joint_layers, trabecular_share
from handpipe.synthetic.acquisition.physics.effects import Effects
from handpipe.synthetic.acquisition.physics.fields import Lengths, sheet, vanishing
from handpipe.synthetic.acquisition.physics.streams import Streams
from handpipe.synthetic.acquisition.physics.subcutaneous import subcutaneous

FASCICLES: Lengths = (40.0, 5.0, 5.0)  # mm of the bundles of a muscle
SEPTA_IN_MUSCLE: Lengths = (60.0, 9.0, 9.0)  # mm of the sheets between the bundles


def detailed(anatomy: ImagedAnatomy, grid: VoxelGrid, effects: Effects, streams: Streams) -> Iterator[Layer]:
    """The subject's layers in paint order, each followed by the structures in it."""
    for number, (tissue, share) in enumerate(anatomy.layers):
        if tissue == "cortical" and (width := effects.size("joints")):
            yield from joint_layers(anatomy.bones, grid, width)
        yield tissue, share
        if number == 0:
            yield from subcutaneous(np.asarray(share), grid, anatomy.palm, effects, streams)
        elif tissue == "muscle" and (thickness := effects.size("muscle_streaks")):
            rng = streams.stream("muscle_streaks")
            for streak, lengths in (("fat", FASCICLES), ("fascia", SEPTA_IN_MUSCLE)):
                yield streak, share * sheet(vanishing(grid, lengths, rng), thickness, grid.spacing)
        elif tissue == "marrow" and (most := effects.size("trabeculae")):
            rng = streams.of_subject("trabeculae")
            yield "trabeculae", trabecular_share(share, anatomy.bones, grid, most, rng)
