"""Curves of muscles while a person edits them: functions, surfaces and faults after each edit."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.anatomy.editing.curve_faults import CurveFaults
    from handpipe.anatomy.editing.draft import (
        Draft,
        content_of,
        load_draft,
        place_on_bone,
        points_of,
        tendon_lines,
        write_curves,
    )
    from handpipe.anatomy.editing.editor import CurveEditor, Edited
else:
    __getattr__ = face(__name__)

__all__ = [
    "CurveEditor",
    "CurveFaults",
    "Draft",
    "Edited",
    "content_of",
    "load_draft",
    "place_on_bone",
    "points_of",
    "tendon_lines",
    "write_curves",
]
