"""Cheap hands that are learned from simulated frames: skinning, and skinning with learned correctives."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.levels.learned_hand import Errors, LearnedBody, LearnedHand, Level
    from handpipe.levels.learned_scene import require_learned
    from handpipe.levels.learning import learn
    from handpipe.levels.portable import write_portable
    from handpipe.levels.training_set import TrainingSet
else:
    __getattr__ = face(__name__)

__all__ = [
    "Errors",
    "LearnedBody",
    "LearnedHand",
    "Level",
    "TrainingSet",
    "learn",
    "require_learned",
    "write_portable",
]
