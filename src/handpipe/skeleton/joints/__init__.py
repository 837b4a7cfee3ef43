"""One joint and the tree of joints: axes, types, angles, limits (Wang 2019 §4)."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.skeleton.joints.joint_tree import RigJoint
    from handpipe.skeleton.joints.joints import fit_joint
    from handpipe.skeleton.joints.limits import limit_rows
else:
    __getattr__ = face(__name__)

__all__ = ["RigJoint", "fit_joint", "limit_rows"]
