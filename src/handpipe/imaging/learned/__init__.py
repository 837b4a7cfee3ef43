"""Bones of images whose tissues strokes teach: what is bone is learned, not assumed."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.imaging.learned.bones import segment_learned
    from handpipe.imaging.learned.confidence import Confidence
    from handpipe.imaging.learned.doubts import learned_appearances, learned_doubts
else:
    __getattr__ = face(__name__)

__all__ = ["Confidence", "learned_appearances", "learned_doubts", "segment_learned"]
