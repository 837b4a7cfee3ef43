"""A complete template of a hand, and its warping.

It consists of bones, joints, muscles, tendons, skin, nails and feature points.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np

from handpipe.core import Array, InputError, IntArray, artifacts
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import TetMesh
from handpipe.tissues.muscles.fitting import PlacedTemplate, place

Side = Literal["right", "left"]

KIND = "subject-template"
MIRROR = np.array([1.0, -1.0, 1.0])  # signs of x, y and z of the other hand


class SpaceMap(Protocol):
    """A map of points (n, 3) in mm with its derivatives (n, 3, 3)."""

    def __call__(self, points: Array) -> Array:
        """Images (n, 3) in mm of points (n, 3) in mm."""
        ...

    def jacobian(self, points: Array) -> Array:
        """Derivatives (n, 3, 3) of the images by the points (n, 3) in mm."""
        ...


@dataclass(frozen=True, eq=False)
class TemplateJoint:
    """A joint's axes and centre in neutral.

    Parameters
    ----------
    name : str
        Name of the joint.
    parent, child : str
        Bone that carries the joint, and bone that it moves.
    angles : tuple of str
        Names of the k angles. Flexion comes first; its positive angles bend towards the palm.
    axes : array (k, 3)
        Unit vectors about which positive angles turn the child, one an angle.
    centre : array (3,)
        Centre of rotation in mm.
    """

    name: str
    parent: str
    child: str
    angles: tuple[str, ...]
    axes: Array
    centre: Array


@dataclass(frozen=True, eq=False)
class TemplateMuscle:
    """A muscle or ligament.

    Parameters
    ----------
    surface : Surface
        Surface in mm.
    attachments : dict of str to array (k,)
        Indices of the surface's vertices that are attached, by bone.
    landmarks : dict of str to array (3,)
        Points in mm by name.
    mesh : TetMesh, optional
        Tets of its volume in mm.
    fibres : array (m, 3), optional
        Unit vectors, one a tet of `mesh`, zero where a tet has no fibres.
    """

    surface: Surface
    attachments: dict[str, IntArray]
    landmarks: dict[str, Array] = field(default_factory=dict)
    mesh: TetMesh | None = None
    fibres: Array | None = None


@dataclass(frozen=True, eq=False)
class TemplateTendon:
    """A tendon's middle line and radius.

    Parameters
    ----------
    path : array (n, 3)
        Points in mm, from its insertion outwards.
    bone : str
        Bone of its insertion.
    bones : tuple of str
        Bones that it passes, from the insertion outwards.
    radius : float
        Radius in mm.
    """

    path: Array
    bone: str
    bones: tuple[str, ...]
    radius: float


@dataclass(frozen=True, eq=False)
class SubjectTemplate:
    """All that is known of a hand in neutral, in one frame, mm.

    Parameters
    ----------
    side : "right" or "left"
        Which hand it is.
    bones : dict of str to Surface
        Surfaces in mm by bone.
    joints : tuple of TemplateJoint
        Joints, each after the joint that carries its parent. The first joint's parent is the root.
    muscles, ligaments : dict of str to TemplateMuscle
        Muscles and ligaments by name.
    tendons : dict of str to TemplateTendon
        Tendons by name.
    skin : Surface, optional
        Surface in mm.
    nails : dict of str to array (k,)
        Indices of the skin's triangles by the nail's bone.
    feature_points : dict of str to array (3,)
        Points in mm by name.
    moves_with : dict of str to str
        Bones that no joint carries, with the bone that each moves with; others move with the root.

    Raises
    ------
    InputError
        Where a joint, muscle, tendon or nail names a bone or vertices that do not exist, a joint comes before
        the joint that carries its parent, or there are nails without a skin.
    """

    side: Side
    bones: dict[str, Surface]
    joints: tuple[TemplateJoint, ...] = ()
    muscles: dict[str, TemplateMuscle] = field(default_factory=dict)
    ligaments: dict[str, TemplateMuscle] = field(default_factory=dict)
    tendons: dict[str, TemplateTendon] = field(default_factory=dict)
    skin: Surface | None = None
    nails: dict[str, IntArray] = field(default_factory=dict)
    feature_points: dict[str, Array] = field(default_factory=dict)
    moves_with: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check names, vertices and the order of joints."""
        for where, bone in self._named_bones():
            if bone not in self.bones:
                known = ", ".join(self.bones)
                raise InputError("template", where, f"names {bone!r}, which is no bone", f"Bones are {known}")
        for i, joint in enumerate(self.joints):
            if joint.parent in {later.child for later in self.joints[i:]}:
                problem = f"comes before the joint that carries {joint.parent}"
                raise InputError("template", f"joints.{joint.name}", problem, "Order joints outwards")
        for name, organ in self._organs():
            for bone, ids in organ.attachments.items():
                if len(ids) == 0 or ids.min() < 0 or ids.max() >= len(organ.surface.vertices):
                    problem = "has vertices that the surface has not, or none"
                    raise InputError("template", f"{name}.attachments.{bone}", problem, "Mark them again")
        if self.nails and self.skin is None:
            raise InputError(
                "template", "nails", "are triangles of a skin that is not there", "Give the skin"
            )

    def _named_bones(self) -> list[tuple[str, str]]:
        return [
            *((f"joints.{j.name}", b) for j in self.joints for b in (j.parent, j.child)),
            *((f"{n}.attachments", b) for n, o in self._organs() for b in o.attachments),
            *((f"tendons.{n}", b) for n, t in self.tendons.items() for b in (t.bone, *t.bones)),
            *(("nails", b) for b in self.nails),
            *(("moves_with", b) for pair in self.moves_with.items() for b in pair),
        ]

    def _organs(self) -> list[tuple[str, TemplateMuscle]]:
        return [
            *((f"muscles.{n}", m) for n, m in self.muscles.items()),
            *((f"ligaments.{n}", m) for n, m in self.ligaments.items()),
        ]

    @property
    def root(self) -> str:
        """The bone that moves all others."""
        return self.joints[0].parent if self.joints else next(iter(self.bones))

    def surfaces(self) -> dict[str, Surface]:
        """Every surface by a name that says what it is: bones, muscles, ligaments and skin."""
        skin = {} if self.skin is None else {"skin": self.skin}
        return self.bones | {n.partition(".")[2]: organ.surface for n, organ in self._organs()} | skin

    def nail_patches(self) -> dict[str, Surface]:
        """The part of the skin that each nail is, by its bone."""
        if self.skin is None:
            return {}
        vertices, triangles = self.skin.vertices, self.skin.triangles
        return {bone: Surface(vertices, triangles[ids]).compact() for bone, ids in self.nails.items()}

    def mirrored(self) -> SubjectTemplate:
        """The other hand, in the mirror of the x-z plane: equal angles are mirror images of one another."""
        image = _transformed(self, _Mirror(), lambda surface, points: surface.moved(points).flipped())
        joints = tuple(replace(j, axes=-j.axes * MIRROR) for j in self.joints)
        centred = (replace(j, centre=j.centre * MIRROR) for j in joints)
        return replace(image, side="left" if self.side == "right" else "right", joints=tuple(centred))

    def save(self, path: str | Path, inputs: Sequence[str | Path] = ()) -> None:
        """Write the artifact."""
        artifacts.write(path, _to_groups(self), kind=KIND, attributes={"units": "mm"}, inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> SubjectTemplate:
        """Read the artifact.

        Parameters
        ----------
        path : path
            File of `save`.

        Returns
        -------
        SubjectTemplate
            The template that was saved.

        Raises
        ------
        InputError
            Where the file is missing or no template.
        """
        return _from_groups(artifacts.read(path, KIND))


def scaled(template: SubjectTemplate, size: float) -> SubjectTemplate:
    """The hand of the same shape that is `size` times as large about the origin.

    Parameters
    ----------
    template : SubjectTemplate
        Hand to be resized.
    size : float
        Factor of all lengths.

    Returns
    -------
    SubjectTemplate
        The larger or smaller hand.
    """
    return warped(template, _Similarity(size))


@dataclass(frozen=True)
class _Similarity:
    size: float

    def __call__(self, points: Array) -> Array:
        return self.size * points

    def jacobian(self, points: Array) -> Array:
        return np.tile(self.size * np.eye(3), (len(points), 1, 1))


class _Mirror:
    def __call__(self, points: Array) -> Array:
        return points * MIRROR

    def jacobian(self, points: Array) -> Array:
        return np.tile(np.diag(MIRROR), (len(points), 1, 1))


def warped(template: SubjectTemplate, warp: SpaceMap) -> SubjectTemplate:
    """The template carried to a person (Albrecht 2003 §5.2, step by step).

    Surfaces, tets and points go by the map. A joint's axes are turned by the rotation in the map's Jacobian
    at its centre, so that angles between axes stay; fibres go by the Jacobian in their tet and stay unit
    vectors; a tendon's radius grows as lengths do on its path. Attachments and nails keep their indices.
    """
    moved = _transformed(template, warp, lambda surface, points: surface.moved(points))
    joints = []
    for joint in template.joints:
        turn = rotation_of(warp.jacobian(joint.centre[None]))[0]
        joints.append(replace(joint, axes=joint.axes @ turn.T, centre=warp(joint.centre[None])[0]))
    return replace(moved, joints=tuple(joints))


def rotation_of(jacobians: Array) -> Array:
    """The rotations (n, 3, 3) nearest to matrices (n, 3, 3)."""
    u, _, vt = np.linalg.svd(jacobians)
    signs = np.ones((len(u), 3))
    signs[:, 2] = np.sign(np.linalg.det(u @ vt))
    return (u * signs[:, None, :]) @ vt


def _transformed(
    template: SubjectTemplate, warp: SpaceMap, moved: Callable[[Surface, Array], Surface]
) -> SubjectTemplate:
    """All but the joints."""

    def surface(old: Surface) -> Surface:
        return moved(old, warp(old.vertices))

    def points(old: Mapping[str, Array]) -> dict[str, Array]:
        return {name: warp(point[None])[0] for name, point in old.items()}

    def organ(old: TemplateMuscle) -> TemplateMuscle:
        mesh, fibres = old.mesh, old.fibres
        if mesh is not None:
            if fibres is not None:
                middles = mesh.vertices[mesh.tets].mean(axis=1)
                fibres = np.einsum("nij,nj->ni", warp.jacobian(middles), fibres)
                fibres = fibres / np.maximum(np.linalg.norm(fibres, axis=1, keepdims=True), 1e-12)
            tets = (
                mesh.tets
                if np.linalg.det(warp.jacobian(mesh.vertices[:1]))[0] > 0
                else mesh.tets[:, [0, 1, 3, 2]]
            )
            mesh = TetMesh(warp(mesh.vertices), tets)
        return TemplateMuscle(surface(old.surface), old.attachments, points(old.landmarks), mesh, fibres)

    def tendon(old: TemplateTendon) -> TemplateTendon:
        growth = np.cbrt(np.abs(np.linalg.det(warp.jacobian(old.path)))).mean()
        return replace(old, path=warp(old.path), radius=float(old.radius * growth))

    return replace(
        template,
        bones={n: surface(s) for n, s in template.bones.items()},
        muscles={n: organ(m) for n, m in template.muscles.items()},
        ligaments={n: organ(m) for n, m in template.ligaments.items()},
        tendons={n: tendon(t) for n, t in template.tendons.items()},
        skin=None if template.skin is None else surface(template.skin),
        feature_points=points(template.feature_points),
    )


def guesses(template: SubjectTemplate, edge: float) -> dict[str, PlacedTemplate]:
    """First guesses of the template's muscles and ligaments, as the fit of muscles takes them.

    Parameters
    ----------
    template : SubjectTemplate
        Template with muscles and ligaments.
    edge : float
        Edge length in mm to which surfaces are remeshed.

    Returns
    -------
    mapping of str to PlacedTemplate
        Guesses by muscle or ligament.

    Raises
    ------
    InputError
        Where remeshing leaves an attachment without vertices.
    """
    organs = {**template.muscles, **template.ligaments}
    return {
        name: place(organ.surface, organ.attachments, lambda points: points, edge, organ.landmarks)
        for name, organ in organs.items()
    }


def _to_groups(template: SubjectTemplate) -> dict[str, Any]:
    def surface(s: Surface) -> dict[str, Any]:
        return {"vertices": s.vertices, "triangles": s.triangles}

    def organ(m: TemplateMuscle) -> dict[str, Any]:
        out = {
            "surface": surface(m.surface),
            "attachments": dict(m.attachments),
            "landmarks": dict(m.landmarks),
        }
        if m.mesh is not None:
            out["mesh"] = {"vertices": m.mesh.vertices, "tets": m.mesh.tets}
            if m.fibres is not None:
                out["mesh"]["fibres"] = m.fibres
        return out

    joints = {
        j.name: {
            "parent": j.parent,
            "child": j.child,
            "angles": list(j.angles),
            "axes": j.axes,
            "centre": j.centre,
        }
        for j in template.joints
    }
    tendons = {
        n: {"path": t.path, "bone": t.bone, "bones": list(t.bones), "radius": t.radius}
        for n, t in template.tendons.items()
    }
    return {
        "side": template.side,
        "bones": {n: surface(s) for n, s in template.bones.items()},
        "joints": joints,
        "muscles": {n: organ(m) for n, m in template.muscles.items()},
        "ligaments": {n: organ(m) for n, m in template.ligaments.items()},
        "tendons": tendons,
        "nails": dict(template.nails),
        "feature_points": dict(template.feature_points),
        "moves_with": dict(template.moves_with),
        **({} if template.skin is None else {"skin": surface(template.skin)}),
    }


def _from_groups(data: dict[str, Any]) -> SubjectTemplate:
    def surface(group: dict[str, Any]) -> Surface:
        return Surface(group["vertices"], group["triangles"])

    def organ(group: dict[str, Any]) -> TemplateMuscle:
        mesh = group.get("mesh")
        return TemplateMuscle(
            surface(group["surface"]),
            group["attachments"],
            group["landmarks"],
            None if mesh is None else TetMesh(mesh["vertices"], mesh["tets"]),
            None if mesh is None else mesh.get("fibres"),
        )

    joints = tuple(
        TemplateJoint(n, g["parent"], g["child"], tuple(g["angles"]), g["axes"], g["centre"])
        for n, g in data["joints"].items()
    )
    tendons = {
        n: TemplateTendon(g["path"], g["bone"], tuple(g["bones"]), float(g["radius"]))
        for n, g in data["tendons"].items()
    }
    return SubjectTemplate(
        data["side"],
        {n: surface(g) for n, g in data["bones"].items()},
        joints,
        {n: organ(g) for n, g in data["muscles"].items()},
        {n: organ(g) for n, g in data["ligaments"].items()},
        tendons,
        surface(data["skin"]) if "skin" in data else None,
        data["nails"],
        data["feature_points"],
        data["moves_with"],
    )
