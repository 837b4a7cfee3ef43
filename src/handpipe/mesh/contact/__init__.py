"""Where surfaces meet or cross, others and themselves; the IPC Toolkit."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.mesh.contact.contact_toolkit import ipctk
    from handpipe.mesh.contact.crossing_triangles import crossings, ways_out
    from handpipe.mesh.contact.gliding_surfaces import gliding
    from handpipe.mesh.contact.self_contacts import SelfContact, self_contact
    from handpipe.mesh.contact.self_cuts import cuts_itself, distance_to
else:
    __getattr__ = face(__name__)

__all__ = [
    "SelfContact",
    "crossings",
    "cuts_itself",
    "distance_to",
    "gliding",
    "ipctk",
    "self_contact",
    "ways_out",
]
