"""Complete templates of the hands that the project knows: the phantom, MyoHand and Z-Anatomy.

Their feature points are those of their bones, since none of them has a skin. Z-Anatomy's has muscles and the
deep flexors' tendons, too. Forearm bones end where the wrist needs no more of them.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from handpipe.anatomy.person import SubjectTemplate, TemplateJoint, TemplateMuscle, bony_feature_points
from handpipe.core import IntArray, RigidTransform
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.synthetic.geometry.kinematics import KnownJoint
from handpipe.synthetic.phantom import phantom_hand, phantom_hand_joints
from handpipe.synthetic.phantom.hand_build import HandBuild
from handpipe.synthetic.phantom.phantom_hand_bones import FINGERS, ROOT
from handpipe.synthetic.real_anatomy import myohand_bones, myohand_model, real_hand, zanatomy_bones
from handpipe.synthetic.real_anatomy.source_meshes import read_mesh, repair_mesh, subdivided
from handpipe.synthetic.real_anatomy.tendon_lines import tendon_lines
from handpipe.synthetic.real_anatomy.zanatomy_source import HAND

log = logging.getLogger(__name__)

FOREARM = 45.0  # mm of radius and ulna that are kept
WRIST = 4.0  # mm from the capitate's near end to the middle of the wrist's motion
ATTACHED = 1.5  # mm from a bone within which a source's muscle counts as attached
MUSCLES = {
    "abductor_digiti_minimi": "Abductor_digiti_minimi_of_hand_r",
    "flexor_digiti_minimi": "Flexor_digiti_minimi_of_hand_r",
    "opponens_digiti_minimi": "Opponens_digiti_minimi_muscle_of_hand_r",
    "abductor_pollicis_brevis": "Abductor_pollicis_brevis_r",
    "opponens_pollicis": "Opponens_pollicis_muscle_r",
    "flexor_pollicis_brevis_superficial": "Superficial_head_of_flexor_pollicis_brevis_r",
    "flexor_pollicis_brevis_deep": "Deep_head_of_flexor_pollicis_brevis_r",
    "adductor_pollicis_transverse": "Transverse_head_of_adductor_pollicis_r",
}
GROUPS = {
    "dorsal_interosseous": "Dorsal_interossei_muscles_of_hand_r",
    "lumbrical": "Lumbrical_muscles_of_hand_r",
}
FLEXOR = "Flexor_digitorum_profundus_r"


def phantom(build: HandBuild | None = None) -> SubjectTemplate:
    """The phantom hand's bones and joints; 23 feature points, since it has no forearm.

    build: of another hand than the median one, at its size.
    """
    bones = {name: Surface(*surface) for name, surface in phantom_hand.hand(build).bones.items()}
    return with_points(bones, template_joints(phantom_hand_joints.joints(build)))


def myohand(folder: Path) -> SubjectTemplate:
    """MyoHand's bones and joints at the model's zero, and its forearm's ends; `InputError` without them."""
    bones, hinges = myohand_bones.read(folder)
    raw = repair_mesh(myohand_model.read_bone(folder / myohand_bones.FOLDER, ROOT), ROOT)
    place = RigidTransform.fit(raw.vertices, bones[ROOT][0])
    forearm = {}
    for name in ("radius", "ulna"):
        mesh = read_mesh(folder / myohand_bones.FOLDER / "rest_pose_m" / f"{name}.ply")
        forearm[name] = _end(Surface(place(1000.0 * mesh.vertices), mesh.triangles))
    return _real(bones, hinges, forearm)


def zanatomy(folder: Path) -> SubjectTemplate:
    """Z-Anatomy's bones, MyoHand's joints on them, intrinsic muscles, deep flexors; `InputError` without."""
    bones, hinges, _ = zanatomy_bones.read(folder)
    file = zanatomy_bones.FILES[ROOT]
    raw = subdivided(repair_mesh(read_mesh(folder / HAND / f"{file}.ply"), ROOT))
    place = RigidTransform.fit(raw.vertices, bones[ROOT][0])

    def placed(file: str) -> Surface:
        mesh = read_mesh(folder / HAND / f"{file}.ply")
        return mesh.moved(place(mesh.vertices))

    forearm = {name: _end(placed(f"{name.capitalize()}_r")) for name in ("radius", "ulna")}
    found = _real(bones, hinges, forearm)
    bodies = {name: placed(file) for name, file in MUSCLES.items()}
    for group, file in GROUPS.items():
        # From the thumb's side outwards: +y is radial.
        parts = sorted(placed(file).components(), key=lambda body: -float(body.vertices[:, 1].mean()))
        bodies |= {f"{group}{i}": body for i, body in enumerate(parts, start=1)}
    muscles = {n: TemplateMuscle(body, _attached(body, found.bones)) for n, body in bodies.items()}
    tendons = tendon_lines(placed(FLEXOR).vertices, found, "flexor", FINGERS)
    return SubjectTemplate(
        "right",
        found.bones,
        found.joints,
        muscles,
        tendons=tendons,
        feature_points=found.feature_points,
        moves_with=found.moves_with,
    )


def _real(
    bones: real_hand.Bones, hinges: Mapping[str, real_hand.SourceHinge], forearm: Mapping[str, Surface]
) -> SubjectTemplate:
    known = real_hand.joints(real_hand.own_frames(bones, hinges), hinges)
    capitate = bones["capitate"][0]
    centre = capitate[np.argmin(capitate[:, 0])] + [WRIST, 0.0, 0.0]
    # The forearm is the child: what bends the hand to its palm turns the forearm the other way.
    wrist = TemplateJoint(
        "wrist",
        "capitate",
        "radius",
        ("wrist_flexion", "wrist_deviation"),
        np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]),
        centre,
    )
    surfaces = {name: Surface(*surface) for name, surface in bones.items()} | dict(forearm)
    return with_points(surfaces, (*template_joints(known), wrist), {"ulna": "radius"})


def template_joints(known: Sequence[KnownJoint]) -> tuple[TemplateJoint, ...]:
    """Joints as a template has them."""
    return tuple(TemplateJoint(j.name, j.parent, j.child, j.angles, j.axes, j.centre) for j in known)


def with_points(
    bones: dict[str, Surface], joints: tuple[TemplateJoint, ...], moves_with: dict[str, str] | None = None
) -> SubjectTemplate:
    """A right hand's bones and joints, with the feature points that its bones suggest."""
    points = bony_feature_points(bones, joints)
    return SubjectTemplate("right", bones, joints, feature_points=points, moves_with=moves_with or {})


def _end(bone: Surface) -> Surface:
    """End of a forearm's bone towards the hand, open where it is cut."""
    near = bone.vertices[:, 0] > bone.vertices[:, 0].max() - FOREARM
    return Surface(bone.vertices, bone.triangles[near[bone.triangles].all(axis=1)]).compact()


def _attached(body: Surface, bones: Mapping[str, Surface]) -> dict[str, IntArray]:
    """The vertices near each bone; none of a muscle that originates from tendons, as lumbricals do."""
    found = {}
    for name, bone in bones.items():
        near = np.flatnonzero(Distance(bone).closest(body.vertices)[0] < ATTACHED)
        if len(near) >= 3:
            found[name] = near
    return found
