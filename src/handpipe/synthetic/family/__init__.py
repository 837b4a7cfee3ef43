"""A family of generated hands that have the proportions of measured people."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.synthetic.family.measured_people import PEOPLE
    from handpipe.synthetic.family.proportions import build_of
else:
    __getattr__ = face(__name__)

__all__ = ["PEOPLE", "build_of"]
