"""The shipped template hand as a whole: surfaces with skin, joints with limits, feature points, poses."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.anatomy.person.subject_template import (
    Side,
    SubjectTemplate,
    TemplateJoint,
    TemplateMuscle,
    TemplateTendon,
)
from handpipe.anatomy.shipped.template_files import HAND, PLACES, POSES, SIDE, SKIN, Fields, fields_of
from handpipe.core import Array
from handpipe.core.configuration import joint_order
from handpipe.imaging.evidence import read_markers
from handpipe.mesh.files import read_surface


@dataclass(frozen=True, eq=False)
class ShippedHand:
    """A template hand that moves without any scan.

    Parameters
    ----------
    template : SubjectTemplate
        Bones, joints that turn, muscles, ligaments, tendons, skin, nails and feature points, mm.
    limits : mapping of str to array (k, 2)
        Lower and upper limit in rad of each angle of a joint, by joint.
    fixed : mapping of str to (str, str)
        Joints that do not turn: parent and child by name.
    poses : Path
        Table of joint angles of some poses, among them `flat`.
    """

    template: SubjectTemplate
    limits: Mapping[str, Array]
    fixed: Mapping[str, tuple[str, str]]
    poses: Path

    @staticmethod
    def load(side: Side = SIDE, source: Path = HAND) -> ShippedHand:
        """Read the hand that `ship` wrote.

        Parameters
        ----------
        side : "right" or "left"
            A left hand is the mirror image: equal angles are mirror images of one another.
        source : path
            Folder of the hand.

        Returns
        -------
        ShippedHand
        """
        fields = fields_of(source=source)
        places = json.loads((source / PLACES).read_text(encoding="utf-8"))
        order = joint_order({name: (j["parent"], j["child"]) for name, j in fields["joints"].items()})
        joints = tuple(
            _joint(name, fields["joints"][name], np.array(places["centres"][name]))
            for name in order
            if fields["joints"][name]["angles"]
        )
        template = SubjectTemplate(
            SIDE,
            {name: read_surface(source / bone["template"]) for name, bone in fields["bones"].items()},
            joints,
            {name: _organ(organ, source) for name, organ in fields["muscles"].items()},
            {name: _organ(organ, source) for name, organ in fields["ligaments"].items()},
            {name: _tendon(tendon, source) for name, tendon in fields["tendons"].items()},
            read_surface(source / SKIN),
            {bone: np.array(ids) for bone, ids in places["nails"].items()},
            {name: np.array(point) for name, point in places["feature_points"].items()},
        )
        limits = {
            joint.name: np.radians(np.array(fields["joints"][joint.name]["limits_deg"], float))
            for joint in joints
        }
        fixed = {
            name: (joint["parent"], joint["child"])
            for name, joint in fields["joints"].items()
            if not joint["angles"]
        }
        return ShippedHand(template if side == SIDE else template.mirrored(), limits, fixed, source / POSES)


def _joint(name: str, fields: Fields, centre: Array) -> TemplateJoint:
    axes = np.array(fields["axis_hints"], float)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return TemplateJoint(name, fields["parent"], fields["child"], tuple(fields["angles"]), axes, centre)


def _organ(fields: Fields, source: Path) -> TemplateMuscle:
    listed = json.loads((source / fields["attachments"]).read_text(encoding="utf-8"))
    attachments = {bone: np.array(ids) for bone, ids in listed.items() if ids}
    return TemplateMuscle(read_surface(source / fields["template"]), attachments)


def _tendon(fields: Fields, source: Path) -> TemplateTendon:
    path, _ = read_markers(source / fields["path"])
    return TemplateTendon(path, fields["bones"][0], tuple(fields["bones"]), fields["radius"])
