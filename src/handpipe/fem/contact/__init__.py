"""Potentials of points on surfaces: attachment, sliding, contact, and barriers that are never crossed."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.fem.contact.barrier import Barrier, CollidingPairs, ConvexBarrier
    from handpipe.fem.contact.constraints import Attachment, Contact, Operator, Sliding, left_deep
    from handpipe.fem.contact.one_sided import penalty
    from handpipe.fem.contact.points import PointPotential, per_point
    from handpipe.fem.contact.pressure import contact_pressures
    from handpipe.fem.contact.surface_contact import SurfaceContact
    from handpipe.fem.contact.surface_sliding import SurfaceSliding
else:
    __getattr__ = face(__name__)

__all__ = [
    "Attachment",
    "Barrier",
    "CollidingPairs",
    "Contact",
    "ConvexBarrier",
    "Operator",
    "PointPotential",
    "Sliding",
    "SurfaceContact",
    "SurfaceSliding",
    "contact_pressures",
    "left_deep",
    "penalty",
    "per_point",
]
