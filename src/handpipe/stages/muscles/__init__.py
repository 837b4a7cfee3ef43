"""Muscles and ligaments: templates, shapes, separation, strains."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.muscles import (
        evaluate_muscles,
        extract_muscle,
        extract_muscle_shapes,
        fit_ligament,
        fit_muscle_strains,
        muscle_files,
        place_templates,
        separate_muscles,
        separate_neutral,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "evaluate_muscles",
    "extract_muscle",
    "extract_muscle_shapes",
    "fit_ligament",
    "fit_muscle_strains",
    "muscle_files",
    "place_templates",
    "separate_muscles",
    "separate_neutral",
]
