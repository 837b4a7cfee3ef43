"""Ligaments: bodies between bones, fitted and simulated as muscles are."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.tissues.ligaments import fitting
    from handpipe.tissues.ligaments.layer import LIGAMENT
else:
    __getattr__ = face(__name__)

__all__ = ["LIGAMENT", "fitting"]
