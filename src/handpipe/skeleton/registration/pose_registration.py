"""All bones of a pose registered, from the root outwards, but those that are missing or fit nowhere."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from functools import partial

import numpy as np

from handpipe.core import ConvergenceError, RigidTransform
from handpipe.core.configuration import Dataset
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.bones.registration_result import Registration, loosest_turn
from handpipe.skeleton.registration.doubts import doubted
from handpipe.skeleton.registration.image_refinement import PoseImages
from handpipe.skeleton.registration.registration import register
from handpipe.skeleton.registration.registration_table import UNSURE
from handpipe.skeleton.rig.rig import outwards

LOG = logging.getLogger(__name__)


def register_pose(
    dataset: Dataset,
    neutral: Mapping[str, Surface],
    target: Mapping[str, Surface],
    images: PoseImages | None = None,
) -> dict[str, Registration]:
    """Registrations of a pose's bones, from the root outwards.

    A bone starts from the transform of its nearest ancestor that was found. Bones that the pose lacks, or
    that fit nowhere, are left out with a warning. Those in doubt (`doubts.doubted`) are kept, with the
    reason.

    Parameters
    ----------
    dataset : Dataset
        Dataset with bones and joints.
    neutral : mapping of str to Surface
        Neutral marrow surfaces in mm by bone.
    target : mapping of str to Surface
        Marrow surfaces in the pose in mm by bone.
    images : PoseImages, optional
        Images of both poses, which choose between places that fit a bone nearly as well, and refine each
        bone's registration.

    Returns
    -------
    dict of str to Registration
        Registrations by bone.

    Raises
    ------
    ConvergenceError
        If no bone of the pose fits.
    """
    parents = {j.child: j.parent for j in dataset.joints.values()}
    found: dict[str, Registration] = {}
    for bone in [dataset.root_bone, *(dataset.joints[j].child for j in outwards(dataset))]:
        if bone not in neutral:
            LOG.warning("%s is left out: neutral lacks it", bone)
            continue
        if bone not in target or len(target[bone].triangles) == 0:
            LOG.warning("%s is missing in this pose", bone)
            continue
        before = parents.get(bone)
        while before is not None and before not in found:
            before = parents.get(before)
        try:
            start = None if before is None else found[before].transform
            choose = None if images is None else partial(images.chosen, bone)
            found[bone] = register(neutral[bone], target[bone], start=start, choose=choose)
        except ConvergenceError as error:
            LOG.warning("%s is left out: %s", bone, error)
            continue
        if images is not None:
            found[bone] = images.refined(bone, found[bone])
        LOG.info("%s: rms %.3f mm", bone, found[bone].rms)
    if not found:
        raise ConvergenceError(
            "Registration", "no bone of the pose fits", "Check the pose's seeds and labels"
        )
    if images is not None:
        found = images.placed_together(found)
    checked = doubted(found, neutral, dataset.joints)
    for bone, registration in checked.items():
        if registration.doubt:
            LOG.warning("%s is in doubt: %s", bone, registration.doubt)
        elif registration.rotation_deviation > UNSURE:
            LOG.warning("%s: the image determines %s poorly", bone, loosest_turn(registration, neutral[bone]))
    return checked


def unmoved(bones: Mapping[str, Surface]) -> dict[str, Registration]:
    """The neutral pose's registrations, in which every bone stays in its place.

    Parameters
    ----------
    bones : mapping of str to Surface
        Neutral surfaces by bone.

    Returns
    -------
    dict of str to Registration
        The identity without error, by bone.
    """
    return dict.fromkeys(bones, Registration(RigidTransform.identity(), 0.0, np.zeros((6, 6))))
