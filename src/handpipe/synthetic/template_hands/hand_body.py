"""The coupled body of a whole hand: a template's mesh with joints that open, sliding tendons, a skin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handpipe.anatomy.person import SubjectTemplate, TemplateMuscle
from handpipe.anatomy.templates import TissueMesh
from handpipe.core import Array, RigidTransform
from handpipe.fem.elements import Material
from handpipe.mesh.contact import gliding
from handpipe.mesh.surfaces import Distance, Surface, arclength, resample
from handpipe.synthetic.continuum.surfaces import outer_faces
from handpipe.synthetic.coupled.coupled_body import (
    CoupledAnatomy,
    CoupledBody,
    CoupledPose,
    SkinContact,
    TendonStrand,
)
from handpipe.synthetic.coupled.joint_spaces import opened

Bones = Mapping[str, RigidTransform]

FAT, MUSCLE, LIGAMENT = Material(3.0, 0.45), Material(10.0, 0.47), Material(30.0, 0.45)  # kPa
SKIN, DEPTH = Material(20.0, 0.45), 2.0  # kPa and mm: depth below the surface to which fat's tets are skin
GLIDING = 2.5  # mm between bones of a joint, below which tissue is attached to neither
STRAND_STEP = 3.0  # mm between points of a tendon
TONE = 50.0  # mN in every tendon
CONTACT = SkinContact(distance=0.3, stiffness=20.0)  # mm, kPa: of the skin with itself
TENSION, SHORTENING = 8.0, 0.15  # kPa and 1, of a muscle whose ends have come nearer by this share


@dataclass(frozen=True, eq=False)
class HandBody:
    """A hand as one body, and the template that it is made from."""

    body: CoupledBody
    subject: SubjectTemplate

    @staticmethod
    def mesh(anatomy: CoupledAnatomy, subject: SubjectTemplate, order: int) -> HandBody:
        """Of what `open_hand` makes of a template, with linear or quadratic tets (order 1 or 2)."""
        body = CoupledBody(anatomy, materials(anatomy), order=2 if order == 2 else 1, contact=CONTACT)
        return HandBody(body, subject)

    @property
    def quadratic(self) -> bool:
        """Whether its tets are quadratic."""
        return self.body.order == 2

    def linear(self) -> HandBody:
        """The same hand of linear tets."""
        return HandBody.mesh(self.body.anatomy, self.subject, 1)

    def pose(self, bones: Bones) -> CoupledPose:
        """The bones in a position, and each muscle as tense as it is short."""
        return CoupledPose(bones, {name: _tension(m, bones) for name, m in self.subject.muscles.items()})


def materials(anatomy: CoupledAnatomy) -> dict[str, Material]:
    """The material of each of a hand's regions."""
    inside = {name: MUSCLE if name in anatomy.fibres else LIGAMENT for name in anatomy.regions}
    return inside | {"fat": FAT, "skin": SKIN}


def open_hand(
    template: TissueMesh, subject: SubjectTemplate, positions: Sequence[Bones], size: float = 1.0
) -> CoupledAnatomy:
    """A template's mesh of fat, muscles and ligaments with open joints, sliding tendons and a skin.

    `positions` are all that its bones will pass. A hand that is `size` times as large as the median one has
    its lengths as much larger, and a tone that pulls with the same stress.
    """
    fibres = {
        name: template.fibres[template.labels == template.names.index(name)] for name in subject.muscles
    }
    strands = {name: _strand(tendon.path, tendon.radius, size) for name, tendon in subject.tendons.items()}
    anatomy = CoupledAnatomy(template.mesh, template.labels, template.names, template.bones, fibres, strands)
    joints = [(joint.parent, joint.child) for joint in subject.joints]
    vertices, bones = template.mesh.vertices, template.bones
    glide = gliding(vertices, bones, subject.bones, joints, positions, size * GLIDING)
    return _with_skin(opened(anatomy, glide), size * DEPTH)


def _with_skin(anatomy: CoupledAnatomy, depth: float) -> CoupledAnatomy:
    """The anatomy whose fat within `depth` mm of the outer surface is a further region, the skin."""
    outer = Surface(anatomy.mesh.vertices, outer_faces(anatomy.mesh, anatomy.bones.values()))
    fat = anatomy.tets_of("fat")
    middles = anatomy.mesh.vertices[anatomy.mesh.tets[fat]].mean(axis=1)
    labels = anatomy.labels.copy()
    labels[fat[Distance(outer.compact()).closest(middles)[0] < depth]] = len(anatomy.regions)
    return replace(anatomy, labels=labels, regions=(*anatomy.regions, "skin"))


def _strand(path: Array, radius: float, size: float) -> TendonStrand:
    points = resample(path, int(arclength(path)[-1] / (size * STRAND_STEP)) + 2)
    return TendonStrand(points, radius=radius, tension=size**2 * TONE)


def _tension(muscle: TemplateMuscle, bones: Bones) -> float:
    """Tension in kPa by how much nearer the muscle's attachments to its first and last bone have come."""
    ends = {bone: muscle.surface.vertices[ids].mean(axis=0) for bone, ids in muscle.attachments.items()}
    if len(ends) < 2:
        return 0.0
    (one, start), *_, (other, end) = ends.items()
    length = np.linalg.norm(bones[one](start[None]) - bones[other](end[None]))
    shortened = 1.0 - length / np.linalg.norm(start - end)
    return float(TENSION * np.clip(shortened / SHORTENING, 0.0, 1.0))
