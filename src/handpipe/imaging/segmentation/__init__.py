"""Which voxels each bone claims: random walkers from seeds, conflicts between bones, proposed seeds."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.imaging.formats.segments import BACKGROUND
    from handpipe.imaging.segmentation import claims
    from handpipe.imaging.segmentation.claims import Appearance, read_looks, save, segment
    from handpipe.imaging.segmentation.labelled_marrow import labelled_bone, require_shown, with_labelled
    from handpipe.imaging.segmentation.merging import merge
    from handpipe.imaging.segmentation.proposed_seeds import (
        marrow_core,
        propose,
        propose_solids,
        share_outside,
    )
    from handpipe.imaging.segmentation.random_walker import Stop, harmonic
    from handpipe.imaging.segmentation.segmentation import (
        BoneProbability,
        SegmentationSettings,
        add_scribbles,
        check_seeds,
        segment_bone,
    )
    from handpipe.imaging.segmentation.strokes import painted
else:
    __getattr__ = face(__name__)

__all__ = [
    "Appearance",
    "BACKGROUND",
    "BoneProbability",
    "SegmentationSettings",
    "Stop",
    "add_scribbles",
    "check_seeds",
    "claims",
    "harmonic",
    "labelled_bone",
    "marrow_core",
    "merge",
    "painted",
    "propose",
    "propose_solids",
    "read_looks",
    "require_shown",
    "save",
    "segment",
    "segment_bone",
    "share_outside",
    "with_labelled",
]
