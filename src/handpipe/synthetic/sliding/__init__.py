"""A finger whose tissues slide on one another: bodies in contact, without friction."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.synthetic.sliding import finger_bodies, finger_poses, finger_subject
else:
    __getattr__ = face(__name__)

__all__ = ["finger_bodies", "finger_poses", "finger_subject"]
