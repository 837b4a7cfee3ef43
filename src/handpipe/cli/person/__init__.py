"""A person's hand from marked points: in a photograph, on a page of its own, or in 3D; and what it plays."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.cli.person.making import Asked, Made, Side, View, make
    from handpipe.cli.person.picture import Picture
    from handpipe.cli.person.points_page import POINTS, PointsServer, mark
else:
    __getattr__ = face(__name__)

__all__ = ["Asked", "Made", "POINTS", "Picture", "PointsServer", "Side", "View", "make", "mark"]
