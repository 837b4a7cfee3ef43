"""Errors against truth and scans, costs of a build, pictures, and the report."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.evaluation.build import Job, build_metrics, read_jobs
    from handpipe.evaluation.frames import (
        figure_metrics,
        figure_names,
        frame_warnings,
        pose_metrics,
        pose_warnings,
        with_figures,
        worst_figures,
        worst_of,
    )
    from handpipe.evaluation.muscles import deepest, error_rows, surface_errors
    from handpipe.evaluation.pictures import bodies
    from handpipe.evaluation.rendering import Camera, Drawable, Image, on_background, render
    from handpipe.evaluation.report import PoseView, ReportInput, write_report
    from handpipe.evaluation.segmentation import bone_warnings, looks_figures
    from handpipe.evaluation.surfaces import dice, surface_distance
    from handpipe.evaluation.table import Row, skin_metrics, skin_rows
else:
    __getattr__ = face(__name__)

__all__ = [
    "Drawable",
    "Camera",
    "Image",
    "Job",
    "PoseView",
    "ReportInput",
    "Row",
    "bodies",
    "bone_warnings",
    "build_metrics",
    "deepest",
    "dice",
    "error_rows",
    "figure_metrics",
    "figure_names",
    "frame_warnings",
    "looks_figures",
    "on_background",
    "pose_metrics",
    "pose_warnings",
    "read_jobs",
    "render",
    "skin_metrics",
    "skin_rows",
    "surface_distance",
    "surface_errors",
    "with_figures",
    "worst_figures",
    "worst_of",
    "write_report",
]
