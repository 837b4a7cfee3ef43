"""Muscles from images: templates, extraction of shapes, strains over poses (Zheng 2022 §4)."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.tissues.muscles.fitting.attachment_files import read_attachments, read_vertex_ids
    from handpipe.tissues.muscles.fitting.extraction import Evidence, PoseData, extract_neutral, extract_poses
    from handpipe.tissues.muscles.fitting.soft_body import SoftBody
    from handpipe.tissues.muscles.fitting.template_bones import Affine, Rival, fit_similarity
    from handpipe.tissues.muscles.fitting.template_placement import (
        BoneWarp,
        PlacedTemplate,
        place,
        require_near_bones,
        through_points,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "Affine",
    "BoneWarp",
    "Evidence",
    "PlacedTemplate",
    "PoseData",
    "Rival",
    "SoftBody",
    "extract_neutral",
    "extract_poses",
    "fit_similarity",
    "place",
    "read_attachments",
    "read_vertex_ids",
    "require_near_bones",
    "through_points",
]
