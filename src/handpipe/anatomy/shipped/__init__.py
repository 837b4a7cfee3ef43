"""The template hand that comes with handpipe: files of surfaces and curves, and a dataset's fields."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.anatomy.shipped.part import bones_of_part
    from handpipe.anatomy.shipped.shipped_hand import ShippedHand
    from handpipe.anatomy.shipped.template_files import HAND, fields_of, install, ship
else:
    __getattr__ = face(__name__)

__all__ = ["HAND", "ShippedHand", "bones_of_part", "fields_of", "install", "ship"]
