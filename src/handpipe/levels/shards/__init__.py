"""Training sets for programs that learn hands: frames of random poses as arrays, in shards, with an index."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.levels.shards.shard import Shard
    from handpipe.levels.shards.shard_index import ShardIndex, write_bodies
else:
    __getattr__ = face(__name__)

__all__ = ["Shard", "ShardIndex", "write_bodies"]
