"""A ligament in neutral and over its poses: as a muscle, but the image does not show its boundary.

Its neutral shape is the placed template. In other poses it is a passive body: its moved attachments, its
bones and the capsule of its joint act on it. Its plastic strains are the identity in every pose, and no pose
space is needed. What a ligament's contraction would be to a muscle, an example shape says, where one
is known.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from handpipe.core import RigidTransform
from handpipe.skeleton.posing import PoseSpace
from handpipe.tissues.muscles import Muscle
from handpipe.tissues.muscles.fitting import PlacedTemplate, SoftBody


def fit_ligament(
    name: str,
    guess: PlacedTemplate,
    parents: Mapping[str, str],
    neutral: str,
    *,
    edge: float = 1.0,
) -> Muscle:
    """A ligament from its placed template, filled with tetrahedra.

    Parameters
    ----------
    name : str
        Name of the ligament.
    guess : PlacedTemplate
        Placed template.
    parents : mapping of str to str
        Parent of each bone.
    neutral : str
        Name of the neutral pose.
    edge : float
        Edge length of the tetrahedra in mm, about.

    Returns
    -------
    Muscle
        The ligament, with no plastic strain in any pose.
    """
    body = SoftBody.fill(guess.surface, guess.attachments, edge)
    still = {bone: RigidTransform.identity() for bone in body.attachments}
    space = PoseSpace.build(list(body.attachments), parents, {neutral: still}, "inverse-distance")
    logs = np.zeros((1, len(body.mesh.tets), 6))
    return Muscle(name, body, space, logs, body.mesh.vertices[None], (still,))
