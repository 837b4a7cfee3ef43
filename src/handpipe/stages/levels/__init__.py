"""Levels below the simulation, learned from frames or of springs: scenes, a page, training sets."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.levels import (
        animate,
        animate_springs,
        export_player,
        index_shards,
        learn_levels,
        make_shard,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "animate",
    "animate_springs",
    "export_player",
    "index_shards",
    "learn_levels",
    "make_shard",
]
