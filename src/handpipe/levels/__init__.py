"""Cheap hands: learned from simulated frames, or of bulging muscles and a skin of springs."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.levels import mass_spring, shards
    from handpipe.levels.fast_skeleton import FastSkeleton
    from handpipe.levels.learned_hand import Errors, LearnedBody, LearnedHand, Level
    from handpipe.levels.learned_scene import require_learned
    from handpipe.levels.learning import learn
    from handpipe.levels.portable import write_portable
    from handpipe.levels.training_set import RIGID_LAYER, TrainingSet
else:
    __getattr__ = face(__name__)

__all__ = [
    "RIGID_LAYER",
    "Errors",
    "FastSkeleton",
    "LearnedBody",
    "LearnedHand",
    "Level",
    "TrainingSet",
    "learn",
    "mass_spring",
    "require_learned",
    "shards",
    "write_portable",
]
