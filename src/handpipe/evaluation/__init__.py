"""Errors against truth and scans, costs of a build, pictures, and the report."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.evaluation.build import Job, build_metrics, read_jobs, read_warnings
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
    from handpipe.evaluation.pictures import cut_picture, extent, inner_picture, outer_picture, png
    from handpipe.evaluation.reliability import coverage, reliability_metrics, reliability_rows
    from handpipe.evaluation.report import PoseView, ReportInput, write_report
    from handpipe.evaluation.segmentation import bone_warnings, looks_figures
    from handpipe.evaluation.sides import VIEWS, camera_views
    from handpipe.evaluation.slices import Contours, Plane, draw_slice
    from handpipe.evaluation.surfaces import curve_distance, dice, surface_distance
    from handpipe.evaluation.table import SKIN_MODELS, Row, skin_metrics, skin_rows
else:
    __getattr__ = face(__name__)

__all__ = [
    "VIEWS",
    "Contours",
    "Job",
    "Plane",
    "PoseView",
    "ReportInput",
    "Row",
    "SKIN_MODELS",
    "bone_warnings",
    "build_metrics",
    "camera_views",
    "coverage",
    "curve_distance",
    "cut_picture",
    "deepest",
    "dice",
    "draw_slice",
    "error_rows",
    "extent",
    "figure_metrics",
    "figure_names",
    "frame_warnings",
    "inner_picture",
    "looks_figures",
    "outer_picture",
    "png",
    "pose_metrics",
    "pose_warnings",
    "read_jobs",
    "read_warnings",
    "reliability_metrics",
    "reliability_rows",
    "skin_metrics",
    "skin_rows",
    "surface_distance",
    "surface_errors",
    "with_figures",
    "worst_figures",
    "worst_of",
    "write_report",
]
