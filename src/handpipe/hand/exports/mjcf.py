"""A rig with its bones and tendons as a model of MuJoCo (MJCF)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from handpipe.core import write_text
from handpipe.hand.appearance import colour
from handpipe.hand.exports.bone_files import BONE_DENSITY, METRE, bone_meshes, numbers, solid, write_bones
from handpipe.skeleton.rig import Rig
from handpipe.tissues.tendons import BonePath

MODEL = "skeleton.xml"
POSES, SEED = 100, 0  # of the random poses in which the rig's residual motions are measured


def write_mjcf(
    folder: str | Path,
    rig: Rig,
    tendons: Sequence[BonePath] = (),
    files: Mapping[str, str] | None = None,
) -> Path:
    """Write the skeleton as `skeleton.xml` and its bones as STL files beside it, m, kg and rad.

    A body's frame is the subject's neutral frame: with the joints at zero it is the world's, and its position
    and its matrix in any pose are the bone's transform from neutral. Each angle of the rig is a hinge of its
    name with its limits. A body's hinges turn in the order of the rig's axes: the second of a saddle has a
    place of its own, the three of a ball joint have one place. Residual motions of joints are left out:
    `residual_motion` measures them. Bones do not touch one another: without cartilage they would in neutral.

    Parameters
    ----------
    folder : path
        Folder to be written; files of the same names are replaced.
    rig : Rig
        Bones and joints.
    tendons : sequence of BonePath
        Tendons, whose points become sites.
    files : mapping of str to str, optional
        Files of the bones below the folder, of `write_bones`; by default they are written.

    Returns
    -------
    Path
        The model.
    """
    folder = Path(folder)
    files = write_bones(folder, rig) if files is None else files
    root = ElementTree.Element("mujoco", model="handpipe")
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="true")
    ElementTree.SubElement(root, "option", integrator="implicitfast", gravity="0 0 0")
    defaults = ElementTree.SubElement(root, "default")
    look = {"density": numbers(BONE_DENSITY), "contype": "0", "conaffinity": "0", "rgba": _colour("bones")}
    ElementTree.SubElement(defaults, "geom", {"type": "mesh", **look})
    ElementTree.SubElement(defaults, "joint", type="hinge")
    ElementTree.SubElement(defaults, "tendon", rgba=_colour("tendons"))
    ElementTree.SubElement(defaults, "site", size=numbers(0.5 * METRE), group="4")
    assets = ElementTree.SubElement(root, "asset")
    for bone, mesh in bone_meshes(rig).items():
        inertia = "exact" if solid(mesh) is mesh else "convex"
        ElementTree.SubElement(assets, "mesh", name=bone, file=files[bone], inertia=inertia)
    _add_bodies(ElementTree.SubElement(root, "worldbody"), rig, tendons)
    if tendons:
        _add_tendons(ElementTree.SubElement(root, "tendon"), tendons)
    ElementTree.indent(root)
    write_text(folder / MODEL, ElementTree.tostring(root, encoding="unicode") + "\n")
    return folder / MODEL


def residual_motion(rig: Rig) -> tuple[float, float]:
    """How far the residual motions of joints, which MuJoCo lacks, move the bones' vertices.

    Parameters
    ----------
    rig : Rig
        Bones and joints.

    Returns
    -------
    mean, largest : float
        Distances in mm of the bones' vertices with and without residual motions, over the same 100 random
        poses within limits.
    """
    rng, limits = np.random.default_rng(SEED), np.array([rig.limits[n] for n in rig.angle_names])
    lower, upper = limits.reshape(-1, 2).T
    found = []
    for values in rng.uniform(lower, upper, (POSES, len(limits))):
        angles = dict(zip(rig.angle_names, values, strict=True))
        full, partial = (rig.bone_transforms(angles, model=model) for model in ("full", "partial"))
        apart = [full[b](s.vertices) - partial[b](s.vertices) for b, s in rig.surfaces.items()]
        found.append(np.linalg.norm(np.concatenate(apart), axis=1))
    return float(np.mean(found)), float(np.max(found))


def _add_bodies(world: ElementTree.Element, rig: Rig, tendons: Iterable[BonePath]) -> None:
    """Bodies from the root outwards, each with its joints, its mesh and the sites of tendons on it."""
    bodies = {rig.root: ElementTree.SubElement(world, "body", name=rig.root)}
    for joint in rig.joints:
        body = bodies[joint.child] = ElementTree.SubElement(bodies[joint.parent], "body", name=joint.child)
        fit = joint.fit
        for turn, i in enumerate(fit.axes.order):
            place = fit.centre + (fit.offset if turn == 1 else 0.0)
            axis, limits = numbers(*fit.axes.directions[i]), numbers(*joint.limits[i])
            where = numbers(*(place * METRE))
            ElementTree.SubElement(body, "joint", name=joint.angles[i], pos=where, axis=axis, range=limits)
    for bone, body in bodies.items():
        ElementTree.SubElement(body, "geom", name=bone, mesh=bone)
    for tendon in tendons:
        for site, bone, point in zip(_sites(tendon), tendon.bones, tendon.points, strict=True):
            ElementTree.SubElement(bodies[bone], "site", name=site, pos=numbers(*(point * METRE)))


def _add_tendons(element: ElementTree.Element, tendons: Iterable[BonePath]) -> None:
    for tendon in tendons:
        width = numbers(tendon.radius * METRE)
        path = ElementTree.SubElement(element, "spatial", name=tendon.name, width=width)
        for site in _sites(tendon):
            ElementTree.SubElement(path, "site", site=site)


def _sites(tendon: BonePath) -> list[str]:
    return [f"{tendon.name}_{number}" for number in range(len(tendon.points))]


def _colour(look: str) -> str:
    return numbers(*colour(look), 1.0)
