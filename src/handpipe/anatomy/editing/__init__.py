"""Curves of muscles while a person edits them: functions, surfaces and faults after each edit."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.anatomy.editing.kept_functions import KeptFunctions
else:
    __getattr__ = face(__name__)

__all__ = ["KeptFunctions"]
