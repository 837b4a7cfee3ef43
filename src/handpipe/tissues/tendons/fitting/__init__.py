"""Tendons from images: extraction in neutral, registration to poses, hooks."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.tissues.tendons.fitting.extraction import centre_finder, extract
    from handpipe.tissues.tendons.fitting.registration import centreline_errors, register
    from handpipe.tissues.tendons.fitting.rough_path import extract_roughly
    from handpipe.tissues.tendons.fitting.surface_fit import TendonTarget
else:
    __getattr__ = face(__name__)

__all__ = ["TendonTarget", "centre_finder", "centreline_errors", "extract", "extract_roughly", "register"]
