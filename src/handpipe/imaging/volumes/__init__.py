"""A volume on a regular grid: readers and writers, checks of its frame, surfaces turned into voxels."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.imaging.volumes.channels import pose_channels, read_channel
    from handpipe.imaging.volumes.label_exports import colours, write_label_description, write_segments
    from handpipe.imaging.volumes.label_map import (
        LabelMap,
        holds_background,
        labelled_names,
        read_label_map,
        require_known,
    )
    from handpipe.imaging.volumes.rasterisation import rasterise
    from handpipe.imaging.volumes.resolution import acquired_voxels
    from handpipe.imaging.volumes.same_frame import (
        Foreground,
        fits_clearly,
        likely_cause,
        require_points_in_image,
        require_scan_in_image,
        unit_of,
    )
    from handpipe.imaging.volumes.shading import without_shading
    from handpipe.imaging.volumes.volume import (
        Labels,
        Volume,
        box,
        pose_volume,
        read_label_table,
        read_labels,
        read_volume,
        write_labels,
        write_volume,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "Foreground",
    "LabelMap",
    "Labels",
    "Volume",
    "acquired_voxels",
    "box",
    "colours",
    "fits_clearly",
    "holds_background",
    "labelled_names",
    "likely_cause",
    "pose_channels",
    "pose_volume",
    "rasterise",
    "read_channel",
    "read_label_map",
    "read_label_table",
    "read_labels",
    "read_volume",
    "require_known",
    "require_points_in_image",
    "require_scan_in_image",
    "unit_of",
    "without_shading",
    "write_label_description",
    "write_labels",
    "write_segments",
    "write_volume",
]
