"""A whole hand from one text file: muscles and ligaments in one mesh with the fat, tendons, nails."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import Field, model_validator

from handpipe.anatomy.person.subject_template import SubjectTemplate, TemplateMuscle, TemplateTendon
from handpipe.anatomy.templates.curves import (
    CurveFile,
    CurvePlace,
    MuscleCurves,
    Positive,
    catmull_rom,
    locate,
    long_axis,
)
from handpipe.anatomy.templates.diffusion import Factorise, superlu
from handpipe.anatomy.templates.domain import Domain
from handpipe.anatomy.templates.tissue_mesh import TissueMesh, build_tissue_mesh
from handpipe.core import InputError, IntArray, Metrics
from handpipe.core.configuration import Model, Name, Vector, load_yaml
from handpipe.mesh.contact import crossings
from handpipe.mesh.surfaces import Distance, Surface, arclength, resample
from handpipe.mesh.tets import Locator, TetMesh

TOUCHING = 0.3  # mm from a bone within which a muscle's end is on it: smoothing moves ends by so much
TENDON_STEP = 1.0  # mm between points of a tendon's path
FINE = 500  # points of a tendon's spline, before they are evenly spaced
DORSAL = 0.3  # least cosine between the skin's normal on a nail and the dorsal direction


class TendonCurve(Model):
    """A tendon's middle line, from its insertion inwards."""

    bone: Name = Field(description="where it inserts")
    bones: tuple[Name, ...] = Field(min_length=1, description="passed, from the insertion inwards")
    radius: Positive = Field(description="mm")
    points: tuple[CurvePlace, ...] = Field(min_length=3)


class NailCurve(Model):
    """The skin's triangles above the end of a bone."""

    bone: Name
    dorsal: Vector = Field(description="rough direction from the bone to the nail")
    along: tuple[float, float] = Field((0.45, 1.1), description="from and to, on the bone's long axis")
    width: Positive = Field(description="mm")


class HandFile(CurveFile):
    """Muscles as in any file of curves; ligaments, which are given like muscles; tendons and nails."""

    ligaments: dict[Name, MuscleCurves] = Field(default_factory=dict)
    tendons: dict[Name, TendonCurve] = Field(default_factory=dict)
    nails: dict[Name, NailCurve] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _names(self) -> HandFile:
        both = set(self.muscles) & set(self.ligaments)
        if both:
            raise ValueError(f"ligaments.{min(both)}: is a muscle's name, too")
        return self

    def curves(self) -> CurveFile:
        """What is cut out of the fat: muscles, then ligaments."""
        organs = {**self.muscles, **self.ligaments}
        return CurveFile(units=self.units, distal=self.distal, fat=self.fat, muscles=organs)


def load_hand(path: str | Path) -> HandFile:
    """Read a file of a hand's curves.

    Parameters
    ----------
    path : path
        YAML file.

    Returns
    -------
    HandFile
        Curves of muscles and ligaments, tendons and nails.

    Raises
    ------
    InputError
        For the first wrong field; the text names the file and where its fields are documented.
    """
    try:
        return load_yaml(path, HandFile)
    except InputError as error:
        raise InputError(path, error.field, error.problem, "See docs/anatomy.md") from error


@dataclass(frozen=True, eq=False)
class HandTemplate:
    """The mesh of all soft tissue between skin and bones, and the same hand organ by organ.

    Parameters
    ----------
    tissue : TissueMesh
        Conforming mesh of fat, muscles and ligaments.
    subject : SubjectTemplate
        Bones, joints, skin, and each organ by itself.
    """

    tissue: TissueMesh
    subject: SubjectTemplate

    def metrics(self) -> Metrics:
        """Numbers of organs, and figures of the mesh; crossings are counted among all surfaces."""
        borders = _borders(self.tissue)
        return {
            **self.tissue.metrics(),
            "muscles": (len(self.subject.muscles), ""),
            "ligaments": (len(self.subject.ligaments), ""),
            "tendons": (len(self.subject.tendons), ""),
            "nails": (len(self.subject.nails), ""),
            "bones": (len(self.subject.bones), ""),
            "intersections": (len(crossings(borders)) + int((self.tissue.mesh.volumes() <= 0).sum()), ""),
            "parts": (sum(len(o.surface.components()) for o in self._organs().values()), ""),
            "least_fat": (self._least_fat(), "mm"),
            "tendons_in_muscle": (self._tendons_in_muscle(), "mm"),
        }

    def _organs(self) -> dict[str, TemplateMuscle]:
        return {**self.subject.muscles, **self.subject.ligaments}

    def _least_fat(self) -> float:
        """The least distance in mm from a muscle or ligament to the skin."""
        assert self.subject.skin is not None
        points = np.concatenate([organ.surface.vertices for organ in self._organs().values()])
        return float(Distance(self.subject.skin).closest(points)[0].min())

    def _tendons_in_muscle(self) -> float:
        """Length in mm of the tendons' middle lines that runs through muscles, where it should not."""
        locator, within = Locator(self.tissue.mesh), 0.0
        for tendon in self.subject.tendons.values():
            points = resample(tendon.path, int(2 * arclength(tendon.path)[-1] / TENDON_STEP))
            tets = locator.tets(points)
            inside = (tets >= 0) & (self.tissue.labels[tets] > 0)
            within += float(inside.mean() * arclength(tendon.path)[-1])
        return within


def build_hand(
    file: HandFile,
    bare: SubjectTemplate,
    edge_length: float,
    *,
    factorise: Factorise = superlu,
    source: str | Path = "hand",
) -> HandTemplate:
    """Fill a hand of bones, joints and skin with the organs of a file.

    Parameters
    ----------
    file : HandFile
        Curves of muscles and ligaments, tendons and nails.
    bare : SubjectTemplate
        Hand with bones, joints and skin. Its muscles, ligaments, tendons and nails are replaced.
    edge_length : float
        Approximate edge length of tets in mm.
    factorise : callable
        Factors symmetric positive definite matrices, see `superlu`.
    source : path
        The file, for messages.

    Returns
    -------
    HandTemplate
        The mesh of soft tissue, and each organ by itself.

    Raises
    ------
    InputError
        Where the hand has no skin, or the file does not fit these bones.
    ConvergenceError
        For volumes of muscles that the mesh cannot meet.
    """
    if bare.skin is None:
        raise InputError("template", "skin", "is not there", "Give the skin as a closed surface")
    for kind, organs in (("tendons", file.tendons), ("nails", file.nails)):
        for name, organ in organs.items():
            if organ.bone not in bare.bones:
                known = ", ".join(bare.bones)
                problem = f"{organ.bone!r} is no bone"
                raise InputError(source, f"{kind}.{name}.bone", problem, f"The bones are {known}")
    domain = Domain.between(bare.skin, bare.bones, edge_length)
    tissue = build_tissue_mesh(file.curves(), domain, bare.bones, factorise=factorise, source=source)
    distances = {name: Distance(surface) for name, surface in bare.bones.items()}
    subject = replace(
        bare,
        muscles={name: _organ(tissue, name, distances) for name in file.muscles},
        ligaments={name: _organ(tissue, name, distances) for name in file.ligaments},
        tendons={
            name: _tendon(tendon, file.distal, bare.bones, source, f"tendons.{name}")
            for name, tendon in file.tendons.items()
        },
        nails={
            nail.bone: nail_triangles(nail, file.distal, bare, source, f"nails.{name}")
            for name, nail in file.nails.items()
        },
    )
    return HandTemplate(tissue, subject)


def _organ(tissue: TissueMesh, name: str, bones: Mapping[str, Distance]) -> TemplateMuscle:
    """A muscle or ligament with its tets and fibres, attached where its ends lie on bones."""
    mesh, used = tissue.part(name)
    triangles, outside = mesh.boundary().triangles, mesh.boundary_vertices()
    surface = Surface(mesh.vertices, triangles).compact()
    ends = np.concatenate([tissue.origins[name], tissue.insertions[name]])
    attached = np.flatnonzero(np.isin(used[outside], ends))
    attachments = {}
    for bone, distance in bones.items():
        near = attached[distance.closest(surface.vertices[attached])[0] < TOUCHING]
        if len(near):
            attachments[bone] = near
    fibres = tissue.fibres[tissue.labels == tissue.names.index(name)]
    return TemplateMuscle(surface, attachments, mesh=TetMesh(mesh.vertices, mesh.tets), fibres=fibres)


def _tendon(
    tendon: TendonCurve, distal: Vector, bones: Mapping[str, Surface], source: str | Path, field: str
) -> TemplateTendon:
    """The tendon on given bones, its path evenly sampled."""
    knots, spline = catmull_rom(locate(tendon.points, bones, distal, source, field))
    fine = spline(np.linspace(0, knots[-1], FINE))
    path = resample(fine, int(arclength(fine)[-1] / TENDON_STEP) + 2)
    return TemplateTendon(path, tendon.bone, tendon.bones, tendon.radius)


def nail_triangles(
    nail: NailCurve, distal: Vector, hand: SubjectTemplate, source: str | Path, field: str
) -> IntArray:
    """Triangles of the skin above the end of a bone.

    Parameters
    ----------
    nail : NailCurve
        Bone, directions and extent of the nail.
    distal : sequence of float
        Rough direction (3,) of the bones' distal ends.
    hand : SubjectTemplate
        Hand with the bone and a skin.
    source : path
        The file that describes the nail, for messages.
    field : str
        The nail's field in the file, for messages.

    Returns
    -------
    array (k,)
        Indices of triangles of the skin.

    Raises
    ------
    InputError
        If there are no such triangles.
    """
    assert hand.skin is not None
    axis, start, end = long_axis(hand.bones[nail.bone], np.array(distal))
    dorsal = np.array(nail.dorsal) - (np.array(nail.dorsal) @ axis) * axis
    dorsal /= np.linalg.norm(dorsal)
    corners = hand.skin.vertices[hand.skin.triangles].mean(axis=1) - start
    share = corners @ axis / np.linalg.norm(end - start)
    near = np.linalg.norm(corners - np.clip(share, 0, 1)[:, None] * (end - start), axis=1) < nail.width
    above = (hand.skin.triangle_normals() @ dorsal > DORSAL) & near
    beside = np.abs(corners @ np.cross(axis, dorsal)) < nail.width / 2
    found = np.flatnonzero(above & beside & (share > nail.along[0]) & (share < nail.along[1]))
    if len(found) == 0:
        raise InputError(source, field, "no triangle of the skin is there", "Change `dorsal` or `width`")
    return found


def _borders(tissue: TissueMesh) -> Surface:
    """All triangles between tets of two tissues, or of one and the outside, each once."""
    mesh = tissue.mesh
    sides = [
        TetMesh(mesh.vertices, mesh.tets[tissue.labels == label]).boundary_faces()[0]
        for label in range(len(tissue.names))
    ]
    triangles = np.unique(np.sort(np.concatenate(sides), axis=1), axis=0)
    return Surface(mesh.vertices, triangles).compact()
