"""Limbs that bend at a joint: the joint that bones propose, and the equilibrium of the tissues."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.anatomy.bending.bent_tissue import Bend, BentLimb, Step, follow_bend
    from handpipe.anatomy.bending.proposed_joints import AXES, ProposedJoint, propose_joints
else:
    __getattr__ = face(__name__)

__all__ = ["AXES", "Bend", "BentLimb", "ProposedJoint", "Step", "follow_bend", "propose_joints"]
