"""Attachments as a person marks them on a template: whole ends of muscles, at the bones they are next to."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial import cKDTree

from handpipe.anatomy.person import SubjectTemplate
from handpipe.anatomy.templates import TissueMesh
from handpipe.core import IntArray
from handpipe.mesh.surfaces import Distance

FEW, REACH = 10, 2.5  # 1 and mm: an end of fewer vertices takes those within that distance of it along


def marked_ends(template: TissueMesh, subject: SubjectTemplate) -> dict[str, dict[str, IntArray]]:
    """Attachments of each muscle and ligament by bone.

    The subject's own attachments are only those vertices that lie on a bone: a few of an end with fat around
    it, and none of a lumbrical, which originates from tendons. A template that is fitted to images needs both
    its ends.

    Parameters
    ----------
    template : TissueMesh
        Tet meshes of the organs with their origins and insertions, in mm.
    subject : SubjectTemplate
        Names of the muscles and ligaments, and surfaces of the bones in mm.

    Returns
    -------
    dict of str to dict of str to integer array
        By organ and bone, the attached vertices of the organ's surface, numbered among its boundary vertices.
    """
    bones = {name: Distance(surface) for name, surface in subject.bones.items()}
    names = [*subject.muscles, *subject.ligaments]
    return {name: _of_organ(template, name, bones) for name in names}


def _of_organ(template: TissueMesh, name: str, bones: Mapping[str, Distance]) -> dict[str, IntArray]:
    mesh, used = template.part(name)
    outside = mesh.boundary_vertices()
    points = mesh.vertices[outside]
    ends = [np.isin(used[outside], end[name]) for end in (template.origins, template.insertions)]
    names = list(bones)
    found: dict[str, list[IntArray]] = {}
    for end in filter(np.any, ends):
        near = end if end.sum() >= FEW else cKDTree(points[end]).query(points)[0] < REACH
        ids = np.flatnonzero(near)
        distances = np.stack([bone.closest(points[ids])[0] for bone in bones.values()], axis=1)
        counts = np.bincount(distances.argmin(axis=1), minlength=len(bones))
        # A vertex or two beside a neighbouring bone belong to the bone of the others.
        kept = np.flatnonzero(counts >= min(FEW, counts.max()))
        owner = kept[distances[:, kept].argmin(axis=1)]
        for bone in kept:
            found.setdefault(names[bone], []).append(ids[owner == bone])
    return {bone: np.unique(np.concatenate(ids)) for bone, ids in found.items()}
