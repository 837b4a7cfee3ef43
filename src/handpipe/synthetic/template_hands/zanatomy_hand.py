"""Z-Anatomy's right hand with its muscles and tendons as a template: one mesh in a skin that is made for it.

Bones, joints and poses are those of `zanatomy_bones`. All that is changed on the way is listed.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from handpipe.anatomy.person import SubjectTemplate, TemplateMuscle, TemplateTendon
from handpipe.anatomy.templates import (
    Domain,
    Factorise,
    HandTemplate,
    NailCurve,
    OrganSolid,
    TissueMesh,
    accounts,
    nail_triangles,
    superlu,
    template_of,
)
from handpipe.core import Array, IntArray, RigidTransform
from handpipe.mesh.generation import remesh, repair
from handpipe.mesh.surfaces import Distance, Surface, arclength, resample
from handpipe.synthetic.phantom.phantom_hand_bones import FINGERS
from handpipe.synthetic.real_anatomy import real_hand, zanatomy_bones
from handpipe.synthetic.real_anatomy.source_meshes import read_mesh, subdivided
from handpipe.synthetic.real_anatomy.tendon_lines import tendon_lines
from handpipe.synthetic.real_anatomy.zanatomy_source import HAND
from handpipe.synthetic.template_hands.hand_templates import template_joints, with_points
from handpipe.synthetic.template_hands.real_skin import skin_around
from handpipe.synthetic.template_hands.zanatomy_organs import ABSENT, AROUND, read_organ, read_solids

Row = dict[str, str | float]
log = logging.getLogger(__name__)

WRIST = -30.0  # mm along x, behind the carpals, where the hand is cut
TENDON_STEP, ROUNDING = 1.0, 6.0  # mm between points of a tendon's path, and over which these are smoothed
JOINT, JOINT_EDGE = 3.0, 1.4  # mm between bones that face one another, and of the tets' edges there
THINNEST = 0.8  # mm, radius of a tendon
TENDONS = (  # file, kind, rays
    ("Flexor_digitorum_profundus_r", "flexor", FINGERS),
    ("Flexor_pollicis_longus_r", "flexor", (1,)),
    ("Extensor_digitorum_r", "extensor", FINGERS),
    ("Extensor_pollicis_longus_r", "extensor", (1,)),
)


@dataclass(frozen=True, eq=False)
class RealHand:
    """A template of real organs, and all that was done to them: rows of organ, what, value and unit."""

    template: HandTemplate
    repairs: list[Row]


def build(folder: Path, edges: Mapping[str, float], *, factorise: Factorise = superlu) -> RealHand:
    """The hand of an anatomy folder; `edges` in mm of triangles on "bone" and "skin", and of tets in "fat".

    Raises
    ------
    InputError
        If the source is absent.
    """
    source = zanatomy_bones.subject(folder)
    whole = {name: Surface(*bone) for name, bone in source.hand.bones.items()}
    raw, sentences = _source_bones(folder)
    place = real_hand.hand_frame({name: (bone.vertices, bone.triangles) for name, bone in raw.items()})
    solids = read_solids(folder, place)
    around = [surface for solid in solids.values() for surface in solid.surfaces]
    around += [read_organ(folder, file, place) for file in AROUND]
    layout = real_hand.layout(source.hand.bones, source.hand.surroundings.frames)
    skin = skin_around(around, whole, layout, WRIST, edges["skin"])
    bones = {name: remesh(bone, edges["bone"]) for name, bone in whole.items()}
    domain = Domain.between(skin, bones, edges["fat"]).refined(_joint_faces(bones), JOINT_EDGE)
    tissue = template_of(solids, domain, bones, factorise=factorise)
    bare = replace(with_points(bones, template_joints(source.motion.joints)), skin=skin)
    subject = replace(
        bare,
        muscles={name: _organ(tissue, name, solid, bones) for name, solid in solids.items()},
        tendons=_tendons(folder, place, bare),
        nails=_nails(bare, layout.frames),
    )
    carved = []
    for name, bone in raw.items():
        carved.append(_row(name, "source", bone.volume(), "mm^3"))
        carved.append(_row(name, "carved_apart", bone.volume() - whole[name].volume(), "mm^3"))
        carved.append(_row(name, "meshed_anew", whole[name].volume() - bones[name].volume(), "mm^3"))
    kept = [row for name, account in accounts(solids, bones, tissue).items() for row in account.rows(name)]
    absent = [_row(name, "absent", 1, "1") for name in ABSENT]
    made = [_row("skin", "made", skin.volume(), "mm^3")]
    return RealHand(HandTemplate(tissue, subject), [*sentences, *carved, *kept, *absent, *made])


def _joint_faces(bones: Mapping[str, Surface]) -> Array:
    """Vertices (n, 3) of bones next to another bone: where joints open, tets are not to reach the skin."""
    owner = np.repeat(np.arange(len(bones)), [len(bone.vertices) for bone in bones.values()])
    points = np.concatenate([bone.vertices for bone in bones.values()])
    pairs = cKDTree(points).query_pairs(JOINT, output_type="ndarray")
    return points[np.unique(pairs[owner[pairs[:, 0]] != owner[pairs[:, 1]]])]


def _row(organ: str, what: str, value: float, unit: str) -> Row:
    return {"organ": organ, "what": what, "value": float(value), "unit": unit}


def _source_bones(folder: Path) -> tuple[dict[str, Surface], list[Row]]:
    """The source's bones as `zanatomy_bones` reads them, and the repairs."""
    bones, rows = {}, []
    for name, file in zanatomy_bones.FILES.items():
        mesh, said = repair(read_mesh(folder / HAND / f"{file}.ply"))
        bones[name] = subdivided(mesh)
        rows += [_row(name, sentence, 1, "1") for sentence in said]
    return bones, rows


def _organ(tissue: TissueMesh, name: str, solid: OrganSolid, bones: Mapping[str, Surface]) -> TemplateMuscle:
    """A muscle with tets and fibres; a vertex at an end is attached to the nearest of that end's bones."""
    mesh, used = tissue.part(name)
    outside = mesh.boundary_vertices()
    surface = mesh.boundary().compact()
    attachments: dict[str, list[IntArray]] = {}
    for chosen, on in ((tissue.origins[name], solid.origin), (tissue.insertions[name], solid.insertion)):
        attached = np.flatnonzero(np.isin(used[outside], chosen))
        if len(on) == 0 or len(attached) == 0:
            continue
        distances = [Distance(bones[bone]).closest(surface.vertices[attached])[0] for bone in on]
        nearest = np.argmin(distances, axis=0)
        for number, bone in enumerate(on):
            if (nearest == number).any():
                attachments.setdefault(bone, []).append(attached[nearest == number])
    fibres = tissue.fibres[tissue.labels == tissue.names.index(name)]
    joined = {bone: np.unique(np.concatenate(ids)) for bone, ids in attachments.items()}
    return TemplateMuscle(surface, joined, mesh=mesh, fibres=fibres)


def _tendons(folder: Path, place: RigidTransform, bare: SubjectTemplate) -> dict[str, TemplateTendon]:
    """The long tendons' middle lines, smooth and evenly sampled."""
    found = {}
    for file, kind, rays in TENDONS:
        lines = tendon_lines(read_organ(folder, file, place).vertices, bare, kind, rays)
        for name, line in lines.items():
            fine = resample(line.path, int(arclength(line.path)[-1] / ROUNDING) + 2)
            path = resample(fine, int(arclength(fine)[-1] / TENDON_STEP) + 2, smooth=True)
            found[name] = replace(line, path=path, radius=max(line.radius, THINNEST))
    return found


def _nails(bare: SubjectTemplate, frames: Mapping[str, RigidTransform]) -> dict[str, IntArray]:
    """The skin's triangles over the back of each distal phalanx."""
    found = {}
    for ray, chain in real_hand.RAYS.items():
        bone = chain[-1]
        distal, _, dorsal = frames[bone].rotation.T
        nail = NailCurve(bone=bone, dorsal=tuple(dorsal), along=(0.4, 1.08), width=13.0 if ray == 1 else 11.0)
        found[bone] = nail_triangles(nail, tuple(distal), bare, "zanatomy-hand", f"nails.{bone}")
    return found
